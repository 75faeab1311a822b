// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/view_tick.hpp"

#include <algorithm>
#include <cmath>

#include "core/fault.hpp"
#include "core/limits.hpp"
#include "core/spatial.hpp"
#include "core/state.hpp"
#include "daemon/control/scene_geometry.hpp"
#include "daemon/recording/record_fields.hpp"
#include "daemon/servo/proxy_initializer.hpp"

namespace wrenchd {
namespace {

double length(double x, double y, double z) {
  return std::sqrt(x * x + y * y + z * z);
}

Pose pose_of(const std::array<double, 7>& x) {
  return {Quaterniond(x[6], x[3], x[4], x[5]), {x[0], x[1], x[2]}};
}

Json json_of(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

/// JSON has no NaN: what is none is null.
Json number(double x) {
  return std::isfinite(x) ? Json(x) : Json(nullptr);
}

template <std::size_t N>
Json numbers(const std::array<double, N>& xs) {
  Json out = Json::array();
  for (const double x : xs) out.push_back(number(x));
  return out;
}

std::string bits_text(std::uint64_t bits, ValueNames names) {
  std::string all;
  const std::vector<std::string> known = value_names(names);
  for (std::size_t i = 0; i < known.size(); ++i)
    if ((bits >> i & 1U) != 0) all += (all.empty() ? "" : ", ") + known[i];
  return all;
}

/// The wrench in the world: where it takes hold, force and torque.
struct Held {
  Vector3d p_W = Vector3d::Zero(), force_W = Vector3d::Zero(), torque_W = Vector3d::Zero();
};

Held held(const ViewTick& tick, const ViewScene* scene) {
  const Vector3d force(tick.F_out[0], tick.F_out[1], tick.F_out[2]),
      torque(tick.F_out[3], tick.F_out[4], tick.F_out[5]);
  const Pose X_WP = pose_of(tick.X_WP);
  if (scene == nullptr) return {X_WP.translation_m, force, torque};
  const Vector3d p_W = X_WP * inverse(scene->X_HT()).translation_m;  // the handle point, with the tool at p
  if (!scene->wrench_about_handle()) return {p_W, force, torque - p_W.cross(force)};
  const Quaterniond& R_WB = scene->X_WB().rotation;
  return {p_W, R_WB * force, R_WB * torque};
}

}  // namespace

bool ViewTick::proxy_valid() const noexcept {
  return std::all_of(X_WQ.begin(), X_WQ.end(), [](double x) { return std::isfinite(x); });
}

double ViewTick::depth_m() const noexcept {
  return length(X_WQ[0] - X_WP[0], X_WQ[1] - X_WP[1], X_WQ[2] - X_WP[2]);
}

double ViewTick::angle_rad() const noexcept {
  if (!proxy_valid()) return std::nan("");
  return rotation_vector((pose_of(X_WP).rotation.conjugate() * pose_of(X_WQ).rotation).normalized()).norm();
}

ChannelValues ViewTick::channels() const noexcept {
  return {F_out[0],     F_out[1],  F_out[2],   length(F_out[0], F_out[1], F_out[2]),
          F_out[3],     F_out[4],  F_out[5],   length(F_out[3], F_out[4], F_out[5]),
          energy_kg_m2, depth_m(), angle_rad()};
}

ViewTick view_tick(const TickState& state) {
  ViewTick tick;
  tick.tick = state.tick();
  tick.time_ns = state.time_ns();
  tick.X_WP = state.hand_pose();
  tick.X_WQ = state.proxy_pose();
  tick.F_out = state.wrench();
  tick.energy_kg_m2 = state.number("energy");
  tick.rendering_id = static_cast<std::uint32_t>(state.integer("rendering"));
  for (std::size_t i = 0; i < std::tuple_size_v<decltype(TickRecord::stage_ns)>; ++i)
    tick.duration_ns += state.integer("stage_ns", i);
  tick.wake_latency_ns = state.integer("wake_latency_ns");
  return tick;
}

ViewTick view_tick(const TickRecord& record) {
  ViewTick tick;
  tick.tick = record.tick;
  tick.time_ns = record.now_ns;
  tick.X_WP = record.X_WP;
  tick.X_WQ = record.X_WQ;
  tick.F_out = record.F_out;
  tick.energy_kg_m2 = record.energy;
  tick.rendering_id = record.rendering_id;
  for (const std::int64_t stage : record.stage_ns) tick.duration_ns += stage;
  tick.wake_latency_ns = record.wake_latency_ns;
  return tick;
}

ViewStatus view_status(const TickState& state) {
  return {state.state(),
          state.text("cause"),
          state.text("limit_causes"),
          state.text("placing"),
          static_cast<unsigned>(state.integer("contacts")),
          state.number("authority"),
          state.number("guard_share"),
          state.contacts()};
}

ViewStatus view_status(const TickRecord& record, std::span<const Touch> touches) {
  ViewStatus words;
  const auto cause = static_cast<Fault>(record.state_cause);
  words.state = name(static_cast<State>(record.state));
  words.cause = cause == Fault::none ? "none" : std::string(fault_row(cause).name);
  words.limits = bits_text(record.limit_causes, ValueNames::limit_bits);
  words.proxy_initialization = name(static_cast<ProxyInitialization>(record.proxy_initialization));
  words.contact_count = record.contacts;
  words.authority = record.authority;
  words.passivity_scale = record.passivity_scale;
  for (const Touch& touch : touches) {
    const auto feature = [](std::uint8_t kind, std::uint32_t first, std::uint32_t second) {
      return text(Feature{static_cast<FeatureKind>(kind), first, second});
    };
    ProxyContact one;
    one.point_W_m = touch.point_W_m;
    one.normal_W = touch.normal_W;
    one.share = touch.share;
    one.multiplier_kg_m = touch.multiplier_kg_m;
    one.obstacle_number = touch.obstacle;
    one.tool_feature = feature(touch.tool_feature_kind, touch.tool_first, touch.tool_second);
    one.obstacle_feature = feature(touch.obstacle_feature_kind, touch.obstacle_first, touch.obstacle_second);
    words.contacts.push_back(std::move(one));
  }
  return words;
}

Json frame_json(const ViewTick& tick, const ViewStatus& words, const ViewScene* scene,
                std::int64_t begin_ns) {
  Json touches = Json::array();
  for (const ProxyContact& touch : words.contacts)
    touches.push_back(
        {{"p", numbers(touch.point_W_m)},
         {"n", numbers(touch.normal_W)},
         {"share", number(touch.share)},
         {"obstacle", scene != nullptr ? scene->obstacle_name(touch.obstacle_number) : touch.obstacle},
         {"tool", touch.tool_feature},
         {"on", touch.obstacle_feature}});
  const Held wrench = held(tick, scene);
  return {{"type", "frame"},
          {"t", 1e-9 * static_cast<double>(tick.time_ns - begin_ns)},
          {"tick", tick.tick},
          {"state", words.state},
          {"cause", words.cause},
          {"p", numbers(tick.X_WP)},
          {"q", tick.proxy_valid() ? numbers(tick.X_WQ) : Json(nullptr)},
          {"F", numbers(tick.F_out)},
          {"wrench",
           {{"at", json_of(wrench.p_W)},
            {"force", json_of(wrench.force_W)},
            {"torque", json_of(wrench.torque_W)}}},
          {"energy", number(tick.energy_kg_m2)},
          {"depth_m", number(tick.depth_m())},
          {"angle_rad", number(tick.angle_rad())},
          {"contacts", words.contact_count},
          {"touches", touches},
          {"authority", number(words.authority)},
          {"guard", number(words.passivity_scale)},
          {"limits", words.limits},
          {"placing", words.proxy_initialization},
          {"took_us", 1e-3 * static_cast<double>(tick.duration_ns)},
          {"late_us", 1e-3 * static_cast<double>(tick.wake_latency_ns)},
          {"moved", scene != nullptr ? scene->moving_obstacle_poses(tick.time_ns) : Json::array()}};
}

std::string history_message(const MinMaxHistory& extremes, std::uint64_t from, std::uint64_t to, bool anew,
                            std::int64_t begin_ns) {
  constexpr std::uint32_t kNumbers = 1 + 2 * kChannelCount;
  const std::array<std::uint32_t, 4> head = {2, anew ? 1U : 0U, static_cast<std::uint32_t>(to - from),
                                             kNumbers};
  std::string out(reinterpret_cast<const char*>(head.data()), sizeof head);
  std::array<double, kNumbers> row{};
  for (std::uint64_t i = from; i < to; ++i) {
    const MinMaxHistory::Bucket& stretch = extremes.at(i);
    row[0] = 1e-9 * static_cast<double>(stretch.begin_ns - begin_ns);
    for (std::size_t k = 0; k < kChannelCount; ++k) {
      row[1 + 2 * k] = stretch.min[k];
      row[2 + 2 * k] = stretch.max[k];
    }
    out.append(reinterpret_cast<const char*>(row.data()), sizeof row);
  }
  return out;
}

}  // namespace wrenchd
