// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_proxy.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// Time that passes in the first step of a world [s].
constexpr double kFirstStep_s = 1e-3;

BodyWorld::Settings world_settings(const Scene& scene, double tool_friction, const GraspStrength& grasp) {
  BodyWorld::Settings settings;
  settings.gravity_W_m_per_s2 = scene.gravity_W_m_per_s2();
  settings.tool_friction = tool_friction;
  settings.grasp = grasp;
  return settings;
}

std::array<double, 3> numbers(const Vector3d& v) noexcept {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

BodyProxy::BodyProxy(const Scene& scene, double tool_friction, const GraspStrength& grasp)
    : world_(scene, scene.bodies(), world_settings(scene, tool_friction, grasp)),
      M_(scene.tool().solid.inertia),
      first_body_(static_cast<std::uint32_t>(scene.obstacle_count())) {
  for (const FreeBody& body : scene.bodies()) starts_.add(body.motion);
}

/// Returns the time that passes for the bodies.
double BodyProxy::step_to(double time_s) noexcept {
  if (!last_time_s_) world_.set_time(time_s);
  const double dt_s =
      last_time_s_ ? std::clamp(time_s - *last_time_s_, kMinStep_s, kMaxStep_s) : kFirstStep_s;
  last_time_s_ = time_s;
  return dt_s;
}

void BodyProxy::move_without_tool(double time_s) noexcept {
  const double dt_s = step_to(time_s);
  world_.step(std::nullopt, dt_s, time_s);
}

bool BodyProxy::enter(const Pose& X_WQ, const BodyPoses& then, double then_s) noexcept {
  if (!world_.admits_tool(X_WQ, {then.begin(), then.size()}, then_s)) return false;
  BodyMotion tool;
  tool.X_WB = X_WQ;
  world_.place(0, tool);
  return true;
}

Penetration BodyProxy::follow(const Pose& X_WP, double stiffness_per_s2, double time_s) noexcept {
  dt_s_ = step_to(time_s);
  until_s_ = time_s;
  hand_ = {X_WP, stiffness_per_s2};
  if (grasp_wanted_) world_.grasp();
  return answer(world_.step(hand_, dt_s_, until_s_));
}

void BodyProxy::move_tool(const Pose& X_WP, const Pose& X_WQ, double stiffness_per_s2,
                          double time_s) noexcept {
  dt_s_ = step_to(time_s);
  until_s_ = time_s;
  hand_ = {X_WP, stiffness_per_s2};
  world_.move_tool(X_WQ, time_s);
}

void BodyProxy::set_grasp(bool wanted) noexcept {
  grasp_wanted_ = wanted;
  if (!wanted) world_.let_go();
}

Penetration BodyProxy::follow_again(const Pose& X_WP) noexcept {
  world_.take_back();
  hand_.X_WP = X_WP;
  return answer(world_.step(hand_, dt_s_, until_s_));
}

/// METHOD (42): what the contacts and a held body leave of the pull of the hand.
Penetration BodyProxy::answer(BodyWorld::Status status) const noexcept {
  Penetration out;
  Projection& q = out.projection;
  q.X_WQ = world_.motion(0).X_WB;
  q.iterations = static_cast<std::uint16_t>(world_.rounds());
  q.energy = energy(M_, hand_.X_WP, q.X_WQ);
  const Wrench pull_W = world_.pull_to(hand_.X_WP);
  Vector3d force_N = pull_W.force_N, torque_Nm = pull_W.torque_Nm;
  const double gyration_m = std::sqrt(M_.H_kg_m2.trace() / (3.0 * M_.mass_kg));
  const double pull_N = std::hypot(force_N.norm(), torque_Nm.norm() / gyration_m);
  for (const BodyContact& c : world_.contacts()) {
    if (c.a != 0) continue;
    ++out.contacts;
    force_N += c.force_W_N;
    torque_Nm += (c.point_W_m - q.X_WQ.translation_m).cross(c.force_W_N);
  }
  const Wrench& load_W = world_.tool_load_W();
  force_N += load_W.force_N;
  torque_Nm += load_W.torque_Nm;
  const bool is_free = out.contacts == 0 && load_W.force_N.isZero(0.0) && load_W.torque_Nm.isZero(0.0);
  const double rest_N = std::hypot(force_N.norm(), torque_Nm.norm() / gyration_m);
  q.status = status == BodyWorld::Status::budget_spent ? ProjectionStatus::budget_spent
             : is_free                                 ? ProjectionStatus::free
                                                       : ProjectionStatus::converged;
  if (q.status == ProjectionStatus::free) {
    q.energy = 0.0;
    return out;
  }
  q.kkt_residual = pull_N > 0.0 ? rest_N / pull_N : 0.0;
  out.eps = log(inverse(hand_.X_WP) * q.X_WQ);
  out.spring_displacement = out.eps;
  out.contacts =
      std::max<std::uint16_t>(out.contacts, 1);  // a tool that waits, or that carries, is held as well
  return out;
}

double BodyProxy::work_kg_m2() const noexcept {
  return 2.0 / hand_.stiffness_per_s2 * world_.work_on_tool_J();
}

Touch BodyProxy::touch_of(const BodyContact& c) const noexcept {
  const Scene& scene = world_.scene_of(c);
  const Feature tool = tool_feature(c.contact, scene, true);
  const Feature other = obstacle_feature(c.contact, scene, true);
  Touch touch;
  touch.point_W_m = numbers(c.point_W_m);
  touch.normal_W = numbers(c.normal_W);
  touch.multiplier_kg_m = 2.0 / hand_.stiffness_per_s2 * c.force_W_N.dot(c.normal_W);
  touch.obstacle =
      c.b == BodyContact::kFixed ? c.contact.obstacle : first_body_ + static_cast<std::uint32_t>(c.b) - 1;
  touch.tool_first = tool.first;
  touch.tool_second = tool.second;
  touch.obstacle_first = other.first;
  touch.obstacle_second = other.second;
  touch.contact_kind = static_cast<std::uint8_t>(c.contact.kind);
  touch.tool_feature_kind = static_cast<std::uint8_t>(tool.kind);
  touch.obstacle_feature_kind = static_cast<std::uint8_t>(other.kind);
  return touch;
}

Touches BodyProxy::touches() const noexcept {
  std::array<Touch, kMaxTouches> largest;  // by multiplier, the largest first
  std::size_t count = 0;
  double sum = 0.0;
  for (const BodyContact& c : world_.contacts()) {
    if (c.a != 0) continue;
    const Touch touch = touch_of(c);
    sum += touch.multiplier_kg_m;
    const auto end = largest.begin() + static_cast<std::ptrdiff_t>(count);
    const auto place = std::upper_bound(largest.begin(), end, touch, [](const Touch& a, const Touch& b) {
      return a.multiplier_kg_m > b.multiplier_kg_m;
    });
    if (place == largest.end()) continue;
    if (count < kMaxTouches) ++count;
    std::move_backward(place, largest.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                       largest.begin() + static_cast<std::ptrdiff_t>(count));
    *place = touch;
  }
  Touches out;
  for (std::size_t i = 0; i < count; ++i) {
    largest[i].load_fraction = sum > 0.0 ? largest[i].multiplier_kg_m / sum : 0.0;
    out.add(largest[i]);
  }
  return out;
}

BodyPoses BodyProxy::poses() const noexcept {
  BodyPoses out;
  for (std::size_t i = 1; i < world_.body_count(); ++i) out.add(world_.motion(i).X_WB);
  return out;
}

void BodyProxy::adopt(const BodyProxy& other) noexcept {
  for (std::size_t i = 1; i < world_.body_count(); ++i) world_.place(i, other.world_.motion(i));
  world_.set_time(other.world_.time_s());
  last_time_s_ = other.last_time_s_;
}

void BodyProxy::restart(double time_s) noexcept {
  for (std::size_t i = 0; i < starts_.size(); ++i) world_.place(i + 1, starts_[i]);
  world_.set_time(time_s);
  last_time_s_.reset();
}

}  // namespace wrenchd
