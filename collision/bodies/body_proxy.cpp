// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_proxy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

std::array<double, 3> numbers(const Vector3d& v) noexcept {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

BodyProxy::BodyProxy(const Scene& scene, double tool_friction, const GraspStrength& grasp)
    : BodyProxy(std::make_shared<SharedWorld>(scene, tool_friction, grasp), 0, scene) {}

BodyProxy::BodyProxy(std::shared_ptr<SharedWorld> shared, std::size_t tool, const Scene& scene)
    : shared_(std::move(shared)),
      world_(shared_->world()),
      tool_(tool),
      body_(world_.body_of(tool)),
      M_(scene.tool().solid.inertia),
      first_body_(static_cast<std::uint32_t>(scene.obstacle_count())) {}

void BodyProxy::move_without_tool(double time_s) noexcept {
  const double dt_s = shared_->advance_to(time_s);
  world_.step(std::nullopt, dt_s, time_s, tool_);
}

bool BodyProxy::enter(const Pose& X_WQ, const BodyPoses& then, double then_s) noexcept {
  if (!world_.admits_tool(X_WQ, {then.begin(), then.size()}, then_s, tool_)) return false;
  world_.enter_tool(tool_, X_WQ);
  return true;
}

Penetration BodyProxy::follow(const Pose& X_WP, double stiffness_per_s2, double time_s) noexcept {
  dt_s_ = shared_->advance_to(time_s);
  until_s_ = time_s;
  hand_ = {X_WP, stiffness_per_s2};
  if (grasp_wanted_) world_.grasp(tool_);
  return answer(world_.step(hand_, dt_s_, until_s_, tool_));
}

void BodyProxy::move_tool(const Pose& X_WP, const Pose& X_WQ, double stiffness_per_s2,
                          double time_s) noexcept {
  dt_s_ = shared_->advance_to(time_s);
  until_s_ = time_s;
  hand_ = {X_WP, stiffness_per_s2};
  world_.move_tool(X_WQ, time_s);
}

void BodyProxy::set_grasp(bool wanted) noexcept {
  grasp_wanted_ = wanted;
  if (!wanted) world_.let_go(tool_);
}

Penetration BodyProxy::follow_again(const Pose& X_WP) noexcept {
  world_.take_back();
  hand_.X_WP = X_WP;
  return answer(world_.step(hand_, dt_s_, until_s_, tool_));
}

/// METHOD (42): what the contacts and a held body leave of the pull of the hand.
Penetration BodyProxy::answer(BodyWorld::Status status) const noexcept {
  Penetration out;
  Projection& q = out.projection;
  q.X_WQ = world_.motion(body_).X_WB;
  q.iterations = static_cast<std::uint16_t>(world_.rounds());
  q.energy = energy(M_, hand_.X_WP, q.X_WQ);
  const Wrench pull_W = world_.pull_to(hand_.X_WP, tool_);
  Vector3d force_N = pull_W.force_N, torque_Nm = pull_W.torque_Nm;
  const double gyration_m = std::sqrt(M_.H_kg_m2.trace() / (3.0 * M_.mass_kg));
  const double pull_N = std::hypot(force_N.norm(), torque_Nm.norm() / gyration_m);
  for (const BodyContact& c : world_.contacts()) {
    if (!concerns_tool(c)) continue;
    ++out.contacts;
    const Vector3d force_W_N = c.a == body_ ? c.force_W_N : Vector3d(-c.force_W_N);
    force_N += force_W_N;
    torque_Nm += (c.point_W_m - q.X_WQ.translation_m).cross(force_W_N);
  }
  const Wrench& load_W = world_.tool_load_W(tool_);
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
  return 2.0 / hand_.stiffness_per_s2 * world_.work_on_tool_J(tool_);
}

Touch BodyProxy::touch_of(const BodyContact& c) const noexcept {
  const bool is_first = c.a == body_;  // the tool has the part of the tool in the contact
  const Scene& scene = world_.scene_of(c);
  Feature tool = tool_feature(c.contact, scene, true);
  Feature other = obstacle_feature(c.contact, scene, true);
  ContactKind kind = c.contact.kind;
  if (!is_first) {
    std::swap(tool, other);
    if (kind != ContactKind::edge_edge)
      kind = kind == ContactKind::vertex_face ? ContactKind::face_vertex : ContactKind::vertex_face;
  }
  const auto place = [&](std::size_t body) {
    return first_body_ + static_cast<std::uint32_t>(world_.place_among_others(body));
  };
  Touch touch;
  touch.point_W_m = numbers(c.point_W_m);
  touch.normal_W = numbers(is_first ? c.normal_W : Vector3d(-c.normal_W));
  touch.multiplier_kg_m = 2.0 / hand_.stiffness_per_s2 * c.force_W_N.dot(c.normal_W);
  touch.obstacle = c.b == BodyContact::kFixed ? c.contact.obstacle : place(is_first ? c.b : c.a);
  touch.tool_first = tool.first;
  touch.tool_second = tool.second;
  touch.obstacle_first = other.first;
  touch.obstacle_second = other.second;
  touch.contact_kind = static_cast<std::uint8_t>(kind);
  touch.tool_feature_kind = static_cast<std::uint8_t>(tool.kind);
  touch.obstacle_feature_kind = static_cast<std::uint8_t>(other.kind);
  return touch;
}

Touches BodyProxy::touches() const noexcept {
  std::array<Touch, kMaxTouches> largest;  // by multiplier, the largest first
  std::size_t count = 0;
  double sum = 0.0;
  for (const BodyContact& c : world_.contacts()) {
    if (!concerns_tool(c)) continue;
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

}  // namespace wrenchd
