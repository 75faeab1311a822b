// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/simulated_arm.hpp"

#include <optional>
#include <stdexcept>
#include <utility>

#include <Eigen/LU>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Substep of the simulated device: a tenth of the fastest time constant of a stiff hand on a light handle.
constexpr Duration kSubstep = std::chrono::nanoseconds(62'500);
constexpr double kJump_m = 0.1;
constexpr double kMinJump_m = 0.01;
/// Number of steps from the home position to a first waypoint out of reach.
constexpr int kStartSteps = 100;

}  // namespace

SimulatedArm::SimulatedArm(const DeviceProfile& profile, const SimulationSettings& settings,
                           std::unique_ptr<EmulatedArm> arm)
    : kinematics_(profile.kinematics),
      X_BD_(profile.X_BD),
      X_DB_(inverse(profile.X_BD)),
      X_EH_(profile.X_EH),
      X_HE_(inverse(profile.X_EH)),
      has_wrist_(profile.kinematics.joints == kMaxJoints),
      hand_(settings),
      target_(reachable(hand_.target())),
      arm_(std::move(arm)),
      handle_(settings, start_pose(profile.name), seconds(kSubstep)),
      configuration_(*find_configuration(handle_.X_BH())) {
  set_encoders(handle_.X_BH());
}

/// Returns the last reachable pose on the way from the home position to the first waypoint.
Pose SimulatedArm::start_pose(const std::string& profile) const {
  const std::optional<Pose> X_DE_home = home_pose(kinematics_);
  if (!X_DE_home)
    throw std::invalid_argument(
        "device profile " + profile +
        " cannot be simulated: its home_counts correspond to no pose; check [kinematics]");
  const Pose X_BH_home = X_BD_ * *X_DE_home * X_EH_;
  const Pose& goal = target_.X_BG;
  Pose reached = X_BH_home;
  for (int i = 0; i <= kStartSteps; ++i) {
    const double s = static_cast<double>(i) / kStartSteps;
    const Pose X_BH{X_BH_home.rotation.slerp(s, goal.rotation),
                    (1.0 - s) * X_BH_home.translation_m + s * goal.translation_m};
    if (!find_configuration(X_BH)) break;
    reached = X_BH;
  }
  return reached;
}

void SimulatedArm::inject(const SimulatedFault& fault) {
  if (fault.kind == SimulatedFault::Kind::bad_quaternion)
    throw std::invalid_argument("an arm sends encoder counts and no quaternion; choose another fault");
  if (!affects_link(fault.kind) && fault.kind != SimulatedFault::Kind::jump)
    throw std::invalid_argument("an emulated arm does not support this fault; the loopback device does");
  faults_.add(fault);
}

/// Returns the target without the rotation of a handle that the arm cannot rotate.
HandTarget SimulatedArm::reachable(HandTarget target) const noexcept {
  if (has_wrist_) return target;
  target.X_BG.rotation = X_BD_.rotation * X_EH_.rotation;
  target.V_BG.angular_rad_per_s.setZero();
  return target;
}

std::optional<SimulatedArm::Configuration> SimulatedArm::find_configuration(const Pose& X_BH) const noexcept {
  const Pose X_DE = X_DB_ * X_BH * X_HE_;
  const std::optional<JointAngles> angles = wrenchd::inverse(kinematics_, X_DE);
  if (!angles) return {};
  return Configuration{X_DE, *angles};
}

/// Returns the wrench of the motors about the handle point, in B. Zero in a singular configuration.
Wrench SimulatedArm::motor_demand() const noexcept {
  const Matrix3d J = jacobian(kinematics_, configuration_.angles, configuration_.X_DE);
  Matrix3d J_inverse;
  bool invertible = false;
  J.computeInverseWithCheck(J_inverse, invertible);
  const Vector3d tau_Nm = joint_torques(kinematics_, arm_->motor_efforts());
  if (!invertible || !is_finite(tau_Nm)) return {};
  const Wrench F_D = shifted(Wrench{J_inverse.transpose() * tau_Nm, Vector3d::Zero()},
                             configuration_.X_DE.rotation * X_EH_.translation_m);
  Wrench F_B = expressed(X_BD_.rotation, F_D);
  if (!has_wrist_) F_B.torque_Nm.setZero();  // the bearings of the handle take the torque
  return F_B;
}

/// Sets the encoders. A jump fault is halved until its pose is reachable.
void SimulatedArm::set_encoders(const Pose& X_BH) noexcept {
  Configuration reported = configuration_;
  if (fault_active_during(SimulatedFault::Kind::jump, now_, now_)) {
    std::optional<Configuration> displaced;
    for (double offset_m = kJump_m; !displaced && offset_m > kMinJump_m; offset_m *= 0.5)
      displaced = find_configuration({X_BH.rotation, X_BH.translation_m + offset_m * Vector3d::UnitX()});
    reported = displaced.value_or(reported);
  }
  arm_->set_counts(joint_counts(kinematics_, reported.angles));
}

void SimulatedArm::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = true;
    power_on_ = now_ = t;
    faults_.power_on(t);
    arm_->advance_to(t, host);
  }
  if (t - now_ > kMaxCatchUp) {
    now_ += (t - now_) / kSubstep * kSubstep;
    handle_.stop();
  }
  for (; now_ + kSubstep <= t;) {
    substep();
    arm_->advance_to(now_, host);
  }
}

void SimulatedArm::substep() noexcept {
  now_ += kSubstep;
  const Pose before = handle_.X_BH();
  target_ = reachable(hand_.advance(now_, now_ - power_on_, seconds(kSubstep)));
  if (hand_.prescribed())
    handle_.step_prescribed(target_, motor_demand());
  else
    handle_.step(target_, motor_demand());
  if (const std::optional<Configuration> next = find_configuration(handle_.X_BH()))
    configuration_ = *next;
  else
    handle_.reset_to(before);
  set_encoders(handle_.X_BH());
  homing_requested_for_ = arm_->homing_requested() ? homing_requested_for_ + kSubstep : Duration{};
  if (homing_requested_for_ >= kHomingDelay) arm_->perform_homing();
}

}  // namespace wrenchd
