// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/hand_motion.hpp"

#include "devices/clamp_norm.hpp"

namespace wrenchd {
namespace {

/// Distance from the path at which the hand is on it again. Far below an encoder step.
constexpr double kOnPath_m = 1e-7;
constexpr double kOnPath_rad = 1e-6;

Vector3d next_velocity(const Vector3d& v, const Vector3d& v_path, const Vector3d& error, double max_speed,
                       double max_change) noexcept {
  const Vector3d wanted = v_path + clamp_norm(HandMotion::kGain_per_s * error, max_speed);
  return v + clamp_norm(wanted - v, max_change);
}

Vector3d rotation_between(const Pose& from, const Pose& to) noexcept {
  return rotation_vector(to.rotation * from.rotation.conjugate());
}

bool close(const Pose& a, const Pose& b) noexcept {
  return (a.translation_m - b.translation_m).norm() < kOnPath_m &&
         rotation_between(a, b).norm() < kOnPath_rad;
}

}  // namespace

HandMotion::HandMotion(const SimulationSettings& settings)
    : path_(settings), prescribed_(has_prescribed_motion(settings)), target_(path_.at(Duration{0})) {}

bool HandMotion::set_goal(const HandGoal& goal) noexcept {
  if (prescribed_) return false;
  goals_.write(goal);
  return true;
}

HandTarget HandMotion::advance(TimePoint now, Duration since_start, double dt_s) noexcept {
  goals_.read(goal_);
  const HandTarget path = path_.at(since_start);
  if (now < goal_.expires) {
    on_path_ = false;
    step_toward({goal_.X_BG, {}}, dt_s);
    return target_;
  }
  if (!on_path_) step_toward(path, dt_s);
  if (close(target_.X_BG, path.X_BG)) on_path_ = true;
  if (on_path_) target_ = path;
  return target_;
}

void HandMotion::step_toward(const HandTarget& goal, double dt_s) noexcept {
  Pose& X = target_.X_BG;
  Twist& V = target_.V_BG;
  V.linear_m_per_s =
      next_velocity(V.linear_m_per_s, goal.V_BG.linear_m_per_s, goal.X_BG.translation_m - X.translation_m,
                    kMaxSpeed_m_per_s, kMaxAcceleration_m_per_s2 * dt_s);
  V.angular_rad_per_s =
      next_velocity(V.angular_rad_per_s, goal.V_BG.angular_rad_per_s, rotation_between(X, goal.X_BG),
                    kMaxSpeed_rad_per_s, kMaxAcceleration_rad_per_s2 * dt_s);
  X.translation_m += dt_s * V.linear_m_per_s;
  X.rotation = (rotation_from(dt_s * V.angular_rad_per_s) * X.rotation).normalized();
}

void HandMotion::displace(const Vector3d& d_B_m) noexcept {
  path_.displace(d_B_m);
  target_ = path_.at(Duration{0});
}

}  // namespace wrenchd
