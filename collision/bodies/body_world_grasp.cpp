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
    tool_load_.force_W_N += c.force_W_N;
    tool_load_.torque_W_Nm += (c.point_W_m - bodies_[0].motion.X_WB.translation_m).cross(c.force_W_N);
  }
  std::erase_if(contacts_, [&](const BodyContact& c) { return c.a == 0 && c.b == most; });
  return true;
}

/// Without the load of the body the tool would be at the hand's pose, or where its other contacts hold it, in
/// the next step.
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
  return {return_->X_WT.rotation.slerp(fraction, X_WP_.rotation),
          return_->X_WT.translation_m + fraction * (X_WP_.translation_m - return_->X_WT.translation_m)};
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

/// METHOD (115): what the held body needs beyond its contacts comes from the tool.
ToolLoad BodyWorld::load_of_held() const noexcept {
  const Body& held = bodies_[grasp_->body];
  if (held.step_s == 0.0) return {};
  const Vector6d gradient = pull_gradient(held, held.X_goal);
  const Pose X_WT = half_way(0);
  ToolLoad load;
  load.force_W_N = -gradient.head<3>();
  Vector3d torque_W_Nm = (X_WT.rotation * grasp_->X_TB.translation_m).cross(load.force_W_N) -
                         X_WT.rotation * (grasp_->X_TB.rotation * Vector3d(gradient.tail<3>()));
  for (const BodyContact& c : contacts_) {
    if (!holds(c.a) && (c.b == BodyContact::kFixed || !holds(c.b))) continue;
    const Vector3d force_W_N = holds(c.a) ? c.force_W_N : Vector3d(-c.force_W_N);
    load.force_W_N += force_W_N;
    torque_W_Nm += (c.point_W_m - X_WT.translation_m).cross(force_W_N);
  }
  // From the axes of the tool half way to those at q.
  load.torque_W_Nm = bodies_[0].X_WQ.rotation * (X_WT.rotation.conjugate() * torque_W_Nm);
  return load;
}

/// What holds the tool back on its way to the hand's pose.
ToolLoad BodyWorld::load_of_return() const noexcept {
  const Body& tool = bodies_[0];
  const Vector6d gradient = pull_gradient(tool, X_WP_) - pull_gradient(tool, tool_goal());
  return {gradient.head<3>(), tool.X_WQ.rotation * Vector3d(gradient.tail<3>())};
}

/// The whole impulse on a held body, of its contacts and of the tool, is that of its gradient, as for a free
/// body. Before the poses of this step become those of the last one.
void BodyWorld::push_held() noexcept {
  grasp_load_ = {};
  if (!grasp_) return;
  Body& held = bodies_[grasp_->body];
  if (held.step_s == 0.0) return;
  grasp_load_ = load_of_held();
  const Vector6d impulse = held.step_s * pull_gradient(held, held.X_goal);
  held.free.velocity_W_m_per_s += impulse.head<3>() / held.M.mass_kg;
  held.free.spin_W += half_way(grasp_->body).rotation * Vector3d(impulse.tail<3>());
}

/// The work on the tool, METHOD (111), and the strength of the grasp.
void BodyWorld::finish_grasp() noexcept {
  const ToolLoad before = tool_load_;
  tool_load_ = grasp_load_;
  if (return_) {
    const ToolLoad back = load_of_return();
    tool_load_.force_W_N += back.force_W_N;
    tool_load_.torque_W_Nm += back.torque_W_Nm;
  }
  const Pose& start = bodies_before_[0].motion.X_WB;
  const Pose& end = bodies_[0].motion.X_WB;
  work_on_tool_J_ +=
      0.5 * (before.force_W_N + tool_load_.force_W_N).dot(end.translation_m - start.translation_m) +
      0.5 * (before.torque_W_Nm + tool_load_.torque_W_Nm)
                .dot(rotation_vector(end.rotation * start.rotation.conjugate()));
  if (!grasp_) return;
  const double share = -std::expm1(-dt_s_ / Grasp::kLoadTime_s);
  grasp_->load.force_W_N += share * (grasp_load_.force_W_N - grasp_->load.force_W_N);
  grasp_->load.torque_W_Nm += share * (grasp_load_.torque_W_Nm - grasp_->load.torque_W_Nm);
  grasp_broke_ = grasp_->load.force_W_N.norm() > settings_.grasp.force_N ||
                 grasp_->load.torque_W_Nm.norm() > settings_.grasp.torque_Nm;
  if (grasp_broke_) let_go();
}

}  // namespace wrenchd
