// SPDX-License-Identifier: GPL-3.0-or-later
// The grasp of a BodyWorld: core/METHOD.md, section 15.9.
#include <algorithm>
#include <array>
#include <cmath>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {

bool BodyWorld::grasp(std::size_t tool) noexcept {
  Tool& hand = tools_[tool];
  if (hand.grasp) return false;
  // Calls use(contact, other body, force on the tool) for the contacts with free bodies.
  const auto for_each_contact = [&](const auto& use) {
    for (const BodyContact& c : contacts_) {
      if (c.b == BodyContact::kFixed) continue;
      if (c.a == hand.body && !is_tool(c.b)) use(c, c.b, c.force_W_N);
      if (c.b == hand.body && !is_tool(c.a)) use(c, c.a, Vector3d(-c.force_W_N));
    }
  };
  std::array<double, kMaxBodies> pressure_N{};
  std::size_t most = 0;
  for_each_contact([&](const BodyContact& c, std::size_t other, const Vector3d&) {
    pressure_N[other] += c.force_W_N.dot(c.normal_W);
    if (most == 0 || pressure_N[other] > pressure_N[most]) most = other;
  });
  if (most == 0) return false;
  const Pose& X_WT = bodies_[hand.body].motion.X_WB;
  hand.grasp = Grasp{most, inverse(X_WT) * bodies_[most].motion.X_WB, {}};
  // What the contacts between the two transmitted, the grasp transmits from now on.
  for_each_contact([&](const BodyContact& c, std::size_t other, const Vector3d& force_W_N) {
    if (other != most) return;
    hand.load_W.force_N += force_W_N;
    hand.load_W.torque_Nm += (c.point_W_m - X_WT.translation_m).cross(force_W_N);
  });
  find_movers();
  std::erase_if(contacts_, [&](const BodyContact& c) {
    return c.b != BodyContact::kFixed && bodies_[c.a].mover == bodies_[c.b].mover;
  });
  return true;
}

/// Starts the return of the tool: without the load of the body, the next step would move the tool to the
/// hand's pose at once.
void BodyWorld::let_go(std::size_t tool) noexcept {
  Tool& hand = tools_[tool];
  if (!hand.grasp) return;
  for (const auto& pair : pairs_)
    if (joins(*pair)) pair->reset();
  hand.grasp.reset();
  hand.back = ToolReturn{bodies_[hand.body].motion.X_WB, 0.0};
  find_movers();
}

/// A held body moves with the first tool that holds it, and so does another tool that holds the same body.
void BodyWorld::find_movers() noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    bodies_[i].mover = i;
    bodies_[i].X_MB = Pose{};
  }
  for (const Tool& tool : tools_) {
    if (!tool.grasp) continue;
    Body& held = bodies_[tool.grasp->body];
    if (held.mover == tool.grasp->body) {
      held.mover = tool.body;
      held.X_MB = tool.grasp->X_TB;
    } else {
      bodies_[tool.body].mover = held.mover;
      bodies_[tool.body].X_MB = held.X_MB * inverse(tool.grasp->X_TB);
    }
  }
}

bool BodyWorld::moves_others(std::size_t body) const noexcept {
  return std::any_of(bodies_.begin(), bodies_.end(),
                     [&](const Body& other) { return other.mover == body && &other != &bodies_[body]; });
}

void BodyWorld::advance_returns() noexcept {
  for (Tool& tool : tools_) {
    if (!tool.back) continue;
    tool.back->elapsed_s += dt_s_;
    if (tool.back->elapsed_s >= ToolReturn::kDuration_s) tool.back.reset();
  }
}

/// METHOD (116).
Pose BodyWorld::tool_goal(const Tool& tool) const noexcept {
  if (!tool.back) return tool.hand->X_WP;
  const double fraction = tool.back->elapsed_s / ToolReturn::kDuration_s;
  return between(tool.back->X_WT, tool.hand->X_WP, fraction);
}

/// Adds the terms of the held bodies to the gradient and the metric of the tool that moves them: METHOD
/// (114).
void BodyWorld::add_held(std::size_t mover, Vector6d& gradient, Matrix6d& metric) const noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (i == mover || bodies_[i].mover != mover) continue;
    const Body& held = bodies_[i];
    Matrix6d J = Matrix6d::Identity();
    J.topRightCorner<3, 3>() =
        -acting_pose_of_mover(i).rotation.toRotationMatrix() * hat(held.X_MB.translation_m);
    J.bottomRightCorner<3, 3>() = held.X_MB.rotation.conjugate().toRotationMatrix();
    gradient += J.transpose() * pull_gradient(held, held.X_goal);
    metric += J.transpose() * metric_of(held) * J;
  }
}

void BodyWorld::move_held(std::size_t mover) noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (i == mover || bodies_[i].mover != mover) continue;
    Pose& X_WQ = bodies_[i].X_WQ;
    X_WQ = bodies_[mover].X_WQ * bodies_[i].X_MB;
    X_WQ.rotation.normalize();
  }
}

/// Returns the vector from the mover's centre of mass to a contact point of a held body, in axes of W. The
/// point of a free body belongs to the middle of the chord along which its centre moves. That middle is not
/// at the fixed distance X_MB from the middle of the mover's way.
Vector3d BodyWorld::arm_of_held(std::size_t body, const Vector3d& point_W_m) const noexcept {
  return acting_pose_of_mover(body).rotation * bodies_[body].X_MB.translation_m + point_W_m -
         acting_pose(body).translation_m;
}

/// METHOD (115): what a held body needs beyond its contacts comes from the tool. Of a tool that another one
/// moves, the same balance gives what it gets from there.
Wrench BodyWorld::load_of_held(const Tool& tool) const noexcept {
  if (bodies_[tool.grasp->body].step_s == 0.0) return {};
  Wrench load_W;
  if (is_held(tool.body)) {
    const Wrench others_W =
        pull_to(bodies_[tool.body].X_goal, bodies_[tool.body].tool) + contacts_on(tool.body);
    return -1.0 * others_W;
  }
  const Quaterniond& end = bodies_[tool.body].X_WQ.rotation;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (i == tool.body || bodies_[i].mover != tool.body) continue;
    const Body& held = bodies_[i];
    const Vector6d gradient = pull_gradient(held, held.X_goal);
    const Pose X_WT = acting_pose_of_mover(i);
    Vector3d force_N = -gradient.head<3>();
    Vector3d torque_W_Nm = (X_WT.rotation * held.X_MB.translation_m).cross(force_N) -
                           X_WT.rotation * (held.X_MB.rotation * Vector3d(gradient.tail<3>()));
    for (const BodyContact& c : contacts_) {
      if (c.a != i && c.b != i) continue;
      const Vector3d force_W_N = c.a == i ? c.force_W_N : Vector3d(-c.force_W_N);
      force_N += force_W_N;
      torque_W_Nm += arm_of_held(i, c.point_W_m).cross(force_W_N);
    }
    load_W.force_N += force_N;
    // From the axes of the tool half way to those at q.
    load_W.torque_Nm += end * (X_WT.rotation.conjugate() * torque_W_Nm);
  }
  return load_W;
}

/// The wrench of the contacts on a body, about its centre of mass, in axes of W.
Wrench BodyWorld::contacts_on(std::size_t body) const noexcept {
  Wrench sum_W;
  for (const BodyContact& c : contacts_) {
    if (c.a != body && c.b != body) continue;
    const Vector3d force_W_N = c.a == body ? c.force_W_N : Vector3d(-c.force_W_N);
    sum_W.force_N += force_W_N;
    sum_W.torque_Nm += (c.point_W_m - acting_pose(body).translation_m).cross(force_W_N);
  }
  return sum_W;
}

/// The wrench with which a pose attracts the tool at q, about its centre of mass, in axes of W.
Wrench BodyWorld::pull_to(const Pose& X_goal, std::size_t tool) const noexcept {
  const Body& body = bodies_[tools_[tool].body];
  const Vector6d gradient = pull_gradient(body, X_goal);
  return {-gradient.head<3>(), body.X_WQ.rotation * Vector3d(-gradient.tail<3>())};
}

/// The whole impulse on a held body, of its contacts and of the tool, is that of its gradient, as for a free
/// body. Before the poses of this step become those of the last one.
void BodyWorld::push_held() noexcept {
  for (Tool& tool : tools_) tool.grasp_load_W = tool.grasp ? load_of_held(tool) : Wrench{};
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Body& held = bodies_[i];
    if (!is_held(i) || is_tool(i) || held.step_s == 0.0) continue;
    const Vector6d impulse = held.step_s * pull_gradient(held, held.X_goal);
    held.free.velocity_W_m_per_s += impulse.head<3>() / held.M.mass_kg;
    held.free.spin_W += half_way(i).rotation * Vector3d(impulse.tail<3>());
  }
}

/// The work on the tools, METHOD (111), and the strength of the grasps.
void BodyWorld::finish_grasps() noexcept {
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& tool = tools_[i];
    if (!tool.hand) continue;
    const Wrench before_W = tool.load_W;
    tool.load_W = tool.grasp_load_W;
    // What keeps the tool from the hand's pose on the way back to it.
    if (tool.back) tool.load_W = tool.load_W + pull_to(tool_goal(tool), i) - pull_to(tool.hand->X_WP, i);
    const Wrench mean_W = 0.5 * (before_W + tool.load_W);
    const Pose& start = bodies_before_[tool.body].motion.X_WB;
    const Pose& end = bodies_[tool.body].motion.X_WB;
    const Quaterniond turn = (end.rotation * start.rotation.conjugate()).normalized();
    tool.work_J += mean_W.force_N.dot(end.translation_m - start.translation_m) +
                   2.0 * std::copysign(1.0, turn.w()) * mean_W.torque_Nm.dot(turn.vec());
    if (!tool.grasp) continue;
    const double share = -std::expm1(-dt_s_ / Grasp::kLoadTime_s);
    Wrench& load_W = tool.grasp->load_W;
    load_W = load_W + share * (tool.grasp_load_W - load_W);
    tool.grasp_broke = load_W.force_N.norm() > settings_.grasp.force_N ||
                       load_W.torque_Nm.norm() > settings_.grasp.torque_Nm;
    if (tool.grasp_broke) let_go(i);
  }
}

}  // namespace wrenchd
