// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/view_tick.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/fault.hpp"
#include "core/limits.hpp"
#include "core/spatial.hpp"
#include "core/state.hpp"
#include "daemon/control/scene_geometry.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/record_fields.hpp"
#include "tools/view/contact_forces.hpp"

namespace wrenchd {
namespace {

double length(double x, double y, double z) {
  return std::sqrt(x * x + y * y + z * z);
}

/// Returns null for NaN and infinity, which JSON lacks.
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

/// Wrench on the hand in the world, about the handle point.
struct HandWrench {
  Vector3d p_WH_m = Vector3d::Zero();
  Vector3d force_W = Vector3d::Zero();
  Vector3d torque_W = Vector3d::Zero();
};

/// Without a scene the frames are unknown. Then the wrench is shown as it was sent, at the tool.
HandWrench hand_wrench(const ViewTick& tick, const ViewScene* scene) {
  const Vector3d force(tick.F_out[0], tick.F_out[1], tick.F_out[2]),
      torque(tick.F_out[3], tick.F_out[4], tick.F_out[5]);
  const Pose X_WP = pose_from_numbers(tick.X_WP);
  if (scene == nullptr) return {X_WP.translation_m, force, torque};
  const Vector3d p_WH_m = X_WP * inverse(scene->X_HT()).translation_m;
  if (!scene->wrench_about_handle()) return {p_WH_m, force, torque - p_WH_m.cross(force)};
  const Quaterniond& R_WB = scene->X_WB().rotation;
  return {p_WH_m, R_WB * force, R_WB * torque};
}

constexpr std::uint32_t kBucketDoubles = 1 + 2 * kChannelCount;

double seconds(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

/// Appends time, then minimum and maximum of each channel.
void append(std::string& out, const MinMaxHistory::Bucket& bucket, std::int64_t begin_ns) {
  std::array<double, kBucketDoubles> row{};
  row[0] = seconds(bucket.begin_ns - begin_ns);
  for (std::size_t k = 0; k < kChannelCount; ++k) {
    row[1 + 2 * k] = bucket.min[k];
    row[2 + 2 * k] = bucket.max[k];
  }
  out.append(reinterpret_cast<const char*>(row.data()), sizeof row);
}

/// "vertex 12", "edge 3-7".
std::string feature_text(std::uint8_t kind, std::uint32_t first, std::uint32_t second) {
  return text(Feature{static_cast<FeatureKind>(kind), first, second});
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
  return rotation_vector(
             (pose_from_numbers(X_WP).rotation.conjugate() * pose_from_numbers(X_WQ).rotation).normalized())
      .norm();
}

ChannelValues ViewTick::channels() const noexcept {
  return {F_out[0],     F_out[1],  F_out[2],   length(F_out[0], F_out[1], F_out[2]),
          F_out[3],     F_out[4],  F_out[5],   length(F_out[3], F_out[4], F_out[5]),
          energy_kg_m2, depth_m(), angle_rad()};
}

TickRecord tick_record(const TickState& state) {
  TickRecord record;
  auto* const bytes = reinterpret_cast<std::byte*>(&record);
  for (const RecordField& field : tick_fields())
    for (std::size_t i = 0; i < field.count; ++i) {
      std::byte* const to = bytes + field.offset + i * size_of(field.type);
      if (field.type == FieldType::f64) {
        const double number = state.number(field.name, i);
        std::memcpy(to, &number, sizeof number);
      } else {  // the low bytes, on the little-endian machines that StateReader accepts
        const std::int64_t number = state.integer(field.name, i);
        std::memcpy(to, &number, size_of(field.type));
      }
    }
  return record;
}

std::vector<ProxyContact> proxy_contacts(std::span<const Touch> contacts) {
  std::vector<ProxyContact> out;
  for (const Touch& contact : contacts) {
    ProxyContact one;
    one.point_W_m = contact.point_W_m;
    one.normal_W = contact.normal_W;
    one.load_fraction = contact.load_fraction;
    one.multiplier_kg_m = contact.multiplier_kg_m;
    one.obstacle_number = contact.obstacle;
    one.tool_feature = feature_text(contact.tool_feature_kind, contact.tool_first, contact.tool_second);
    one.obstacle_feature =
        feature_text(contact.obstacle_feature_kind, contact.obstacle_first, contact.obstacle_second);
    out.push_back(std::move(one));
  }
  return out;
}

ViewTick view_tick(const TickRecord& record) {
  ViewTick tick;
  tick.tick = record.tick;
  tick.time_ns = record.now_ns;
  tick.X_BH = record.X_BH;
  tick.X_WP = record.X_WP;
  tick.X_WQ = record.X_WQ;
  tick.X_WB = record.X_WB;
  tick.F_out = record.F_out;
  tick.energy_kg_m2 = record.energy;
  tick.rendering_id = record.rendering_id;
  for (const std::int64_t stage : record.stage_ns) tick.duration_ns += stage;
  tick.wake_latency_ns = record.wake_latency_ns;
  return tick;
}

ViewStatus view_status(const TickRecord& record, std::vector<ProxyContact> contacts) {
  ViewStatus status;
  status.state = name(static_cast<State>(record.state));
  status.cause = fault_row(record.state_cause).name;
  status.limits = bits_text(record.limit_causes, ValueNames::limit_bits);
  status.proxy_initialization = name(static_cast<ProxyInitialization>(record.proxy_initialization));
  status.contact_count = record.contacts;
  status.authority = record.authority;
  status.passivity_scale = record.passivity_scale;
  status.contacts = std::move(contacts);
  return status;
}

Json frame_json(const ViewTick& tick, const ViewStatus& status, const ViewScene* scene,
                std::int64_t begin_ns) {
  const HandWrench wrench = hand_wrench(tick, scene);
  std::vector<double> forces_N(status.contacts.size(), std::nan(""));
  if (scene != nullptr)  // without a scene the frame of the wrench is unknown
    forces_N = contact_forces_N(status.contacts, wrench.p_WH_m, wrench.force_W, wrench.torque_W);
  Json contacts = Json::array();
  for (std::size_t i = 0; i < status.contacts.size(); ++i) {
    const ProxyContact& contact = status.contacts[i];
    contacts.push_back(
        {{"p", numbers(contact.point_W_m)},
         {"n", numbers(contact.normal_W)},
         {"load_fraction", number(contact.load_fraction)},
         {"force_N", number(forces_N[i])},
         {"obstacle", scene != nullptr ? scene->obstacle_name(contact.obstacle_number) : contact.obstacle},
         {"tool", contact.tool_feature},
         {"on", contact.obstacle_feature}});
  }
  return {{"type", "frame"},
          {"t", 1e-9 * static_cast<double>(tick.time_ns - begin_ns)},
          {"tick", tick.tick},
          {"state", status.state},
          {"cause", status.cause},
          {"hand", numbers(tick.X_BH)},
          {"p", numbers(tick.X_WP)},
          {"q", tick.proxy_valid() ? numbers(tick.X_WQ) : Json(nullptr)},
          {"F", numbers(tick.F_out)},
          {"wrench",
           {{"at", json_of(wrench.p_WH_m)},
            {"force", json_of(wrench.force_W)},
            {"torque", json_of(wrench.torque_W)}}},
          {"energy", number(tick.energy_kg_m2)},
          {"depth_m", number(tick.depth_m())},
          {"angle_rad", number(tick.angle_rad())},
          {"contact_count", status.contact_count},
          {"contacts", contacts},
          {"authority", number(status.authority)},
          {"passivity_scale", number(status.passivity_scale)},
          {"limits", status.limits},
          {"proxy_initialization", status.proxy_initialization},
          {"moved", scene != nullptr ? scene->moved_poses(tick.time_ns, tick.X_WB) : Json::array()}};
}

std::string history_message(const MinMaxHistory& history, std::uint64_t from, std::uint64_t to, bool reset,
                            std::int64_t begin_ns) {
  const std::array<std::uint32_t, 4> head = {2, reset ? 1U : 0U, static_cast<std::uint32_t>(to - from),
                                             kBucketDoubles};
  std::string out(reinterpret_cast<const char*>(head.data()), sizeof head);
  for (std::uint64_t i = from; i < to; ++i) append(out, history.at(i), begin_ns);
  return out;
}

std::string columns_message(ColumnsFor purpose, std::uint32_t recording, const MinMaxColumns& columns,
                            std::int64_t begin_ns) {
  const std::array<std::uint32_t, 4> head = {static_cast<std::uint32_t>(purpose), recording,
                                             static_cast<std::uint32_t>(columns.columns().size()),
                                             kBucketDoubles};
  const std::array<double, 2> range = {seconds(columns.from_ns() - begin_ns),
                                       seconds(columns.to_ns() - begin_ns)};
  std::string out(reinterpret_cast<const char*>(head.data()), sizeof head);
  out.append(reinterpret_cast<const char*>(range.data()), sizeof range);
  for (const MinMaxHistory::Bucket& column : columns.columns()) append(out, column, begin_ns);
  return out;
}

}  // namespace wrenchd
