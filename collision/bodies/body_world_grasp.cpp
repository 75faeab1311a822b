// SPDX-License-Identifier: GPL-3.0-or-later
// The grasp of a BodyWorld: core/METHOD.md, section 15.9.
#include <algorithm>
#include <array>
#include <cmath>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {

bool BodyWorld::grasp() noexcept {
  if (grasp_) return false;
  std::array<double, kMaxBodies> pressure_N{};
  std::size_t most = 0;
  for (const BodyContact& c : contacts_) {
    if (c.a != 0 || c.b == BodyContact::kFixed) continue;
    pressure_N[c.b] += c.force_W_N.dot(c.normal_W);
    if (most == 0 || pressure_N[c.b] > pressure_N[most]) most = c.b;
  }
  if (most == 0) return false;
  grasp_ = Grasp{most, inverse(bodies_[0].motion.X_WB) * bodies_[most].motion.X_WB, {}};
  // What the contacts between the two transmitted, the grasp transmits from now on.
  for (const BodyContact& c : contacts_) {
    if (c.a != 0 || c.b != most) continue;
    tool_load_W_.force_N += c.force_W_N;
    tool_load_W_.torque_Nm += (c.point_W_m - bodies_[0].motion.X_WB.translation_m).cross(c.force_W_N);
  }
  std::erase_if(contacts_, [&](const BodyContact& c) { return c.a == 0 && c.b == most; });
  return true;
}

/// Starts the return of the tool: without the load of the body, the next step would move the tool to the
/// hand's pose at once.
void BodyWorld::let_go() noexcept {
  if (!grasp_) return;
  for (const auto& pair : pairs_)
    if (joins(*pair)) pair->reset();
  grasp_.reset();
  return_ = ToolReturn{bodies_[0].motion.X_WB, 0.0};
}

void BodyWorld::advance_return() noexcept {
  if (!return_) return;
  return_->elapsed_s += dt_s_;
  if (return_->elapsed_s >= ToolReturn::kDuration_s) return_.reset();
}

/// METHOD (116).
Pose BodyWorld::tool_goal() const noexcept {
  if (!return_) return X_WP_;
  const double fraction = return_->elapsed_s / ToolReturn::kDuration_s;
  return between(return_->X_WT, X_WP_, fraction);
}

/// Adds the terms of the held body to the gradient and the metric of the tool: METHOD (114).
void BodyWorld::add_held(Vector6d& gradient, Matrix6d& metric) const noexcept {
  const Body& held = bodies_[grasp_->body];
  const Pose& X_TB = grasp_->X_TB;
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -half_way(0).rotation.toRotationMatrix() * hat(X_TB.translation_m);
  J.bottomRightCorner<3, 3>() = X_TB.rotation.conjugate().toRotationMatrix();
  gradient += J.transpose() * pull_gradient(held, held.X_goal);
  metric += J.transpose() * metric_of(held) * J;
}

void BodyWorld::move_held() noexcept {
  Pose& X_WQ = bodies_[grasp_->body].X_WQ;
  X_WQ = bodies_[0].X_WQ * grasp_->X_TB;
  X_WQ.rotation.normalize();
}

/// Returns the vector from the tool's centre of mass to a contact point of the held body, in axes of W,
/// halfway through the tick. The point belongs to the body at the middle of the chord along which its centre
/// moves. That middle is not at the fixed distance X_TB from the middle of the tool's way.
Vector3d BodyWorld::arm_of_held(const Vector3d& point_W_m) const noexcept {
  return half_way(0).rotation * grasp_->X_TB.translation_m + point_W_m - half_way(grasp_->body).translation_m;
}

/// METHOD (115): what the held body needs beyond its contacts comes from the tool.
Wrench BodyWorld::load_of_held() const noexcept {
  const Body& held = bodies_[grasp_->body];
  if (held.step_s == 0.0) return {};
  const Vector6d gradient = pull_gradient(held, held.X_goal);
  const Pose X_WT = half_way(0);
  Wrench load_W;
  load_W.force_N = -gradient.head<3>();
  Vector3d torque_W_Nm = (X_WT.rotation * grasp_->X_TB.translation_m).cross(load_W.force_N) -
                         X_WT.rotation * (grasp_->X_TB.rotation * Vector3d(gradient.tail<3>()));
  for (const BodyContact& c : contacts_) {
    if (!holds(c.a) && (c.b == BodyContact::kFixed || !holds(c.b))) continue;
    const Vector3d force_W_N = holds(c.a) ? c.force_W_N : Vector3d(-c.force_W_N);
    load_W.force_N += force_W_N;
    torque_W_Nm += arm_of_held(c.point_W_m).cross(force_W_N);
  }
  // From the axes of the tool half way to those at q.
  load_W.torque_Nm = bodies_[0].X_WQ.rotation * (X_WT.rotation.conjugate() * torque_W_Nm);
  return load_W;
}

/// The wrench with which a pose attracts the tool at q, about its centre of mass, in axes of W.
Wrench BodyWorld::pull_to(const Pose& X_goal) const noexcept {
  const Vector6d gradient = pull_gradient(bodies_[0], X_goal);
  return {-gradient.head<3>(), bodies_[0].X_WQ.rotation * Vector3d(-gradient.tail<3>())};
}

/// The whole impulse on a held body, of its contacts and of the tool, is that of its gradient, as for a free
/// body. Before the poses of this step become those of the last one.
void BodyWorld::push_held() noexcept {
  grasp_load_W_ = {};
  if (!grasp_) return;
  Body& held = bodies_[grasp_->body];
  if (held.step_s == 0.0) return;
  grasp_load_W_ = load_of_held();
  const Vector6d impulse = held.step_s * pull_gradient(held, held.X_goal);
  held.free.velocity_W_m_per_s += impulse.head<3>() / held.M.mass_kg;
  held.free.spin_W += half_way(grasp_->body).rotation * Vector3d(impulse.tail<3>());
}

/// The work on the tool, METHOD (111), and the strength of the grasp.
void BodyWorld::finish_grasp() noexcept {
  const Wrench before_W = tool_load_W_;
  tool_load_W_ = grasp_load_W_;
  // What keeps the tool from the hand's pose on the way back to it.
  if (return_) tool_load_W_ = tool_load_W_ + pull_to(tool_goal()) - pull_to(X_WP_);
  const Wrench mean_W = 0.5 * (before_W + tool_load_W_);
  const Pose& start = bodies_before_[0].motion.X_WB;
  const Pose& end = bodies_[0].motion.X_WB;
  const Quaterniond turn = (end.rotation * start.rotation.conjugate()).normalized();
  work_on_tool_J_ += mean_W.force_N.dot(end.translation_m - start.translation_m) +
                     2.0 * std::copysign(1.0, turn.w()) * mean_W.torque_Nm.dot(turn.vec());
  if (!grasp_) return;
  const double share = -std::expm1(-dt_s_ / Grasp::kLoadTime_s);
  Wrench& load_W = grasp_->load_W;
  load_W = load_W + share * (grasp_load_W_ - load_W);
  grasp_broke_ =
      load_W.force_N.norm() > settings_.grasp.force_N || load_W.torque_Nm.norm() > settings_.grasp.torque_Nm;
  if (grasp_broke_) let_go();
}

}  // namespace wrenchd
