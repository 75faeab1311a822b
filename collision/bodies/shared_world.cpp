// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/shared_world.hpp"

#include <algorithm>

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

}  // namespace

SharedWorld::SharedWorld(const Scene& scene, double tool_friction, const GraspStrength& grasp)
    : world_(scene, scene.bodies(), world_settings(scene, tool_friction, grasp)) {
  for (const FreeBody& body : scene.bodies())
    if (!body.of_hand) starts_.add(body.motion);
}

double SharedWorld::advance_to(double time_s) noexcept {
  if (!last_time_s_) world_.set_time(time_s);
  const double dt_s =
      last_time_s_ ? std::clamp(time_s - *last_time_s_, kMinStep_s, kMaxStep_s) : kFirstStep_s;
  last_time_s_ = time_s;
  return dt_s;
}

void SharedWorld::adopt(const SharedWorld& other) noexcept {
  for (std::size_t i = 1; i <= starts_.size(); ++i) world_.place(i, other.world_.motion(i));
  world_.set_time(other.world_.time_s());
  last_time_s_ = other.last_time_s_;
}

void SharedWorld::restart(double time_s) noexcept {
  for (std::size_t i = 0; i < starts_.size(); ++i) world_.place(i + 1, starts_[i]);
  world_.set_time(time_s);
  last_time_s_.reset();
}

BodyPoses SharedWorld::poses_without(std::size_t tool) const noexcept {
  BodyPoses out;
  for (std::size_t i = 1; i <= starts_.size(); ++i) out.add(world_.motion(i).X_WB);
  for (std::size_t other = 0; other < world_.tool_count(); ++other) {
    if (other == tool) continue;
    Pose far_away;
    far_away.translation_m.z() = -kFarBelow_m;
    out.add(world_.has_hand(other) ? world_.motion(world_.body_of(other)).X_WB : far_away);
  }
  return out;
}

}  // namespace wrenchd
