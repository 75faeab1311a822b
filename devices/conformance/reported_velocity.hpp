// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "devices/conformance/rule_result.hpp"

namespace wrenchd {

/// One pose sample of a device, in the device's own frames.
struct MotionSample {
  double time_s = 0.0;  ///< device time
  Pose X_BH;            ///< the quaternion as reported
  Twist V_BH;           ///< velocity as reported
};

/// Comparison of a reported velocity with the differenced pose, for one axis.
struct VelocityAgreement {
  double travel = 0.0;  ///< path length along or about the axis [m] or [rad]
  double slope = 0.0;   ///< reported velocity per differenced velocity, least squares; 1 is correct
  /// root mean square of (reported - slope * differenced), relative to that of the differenced velocity
  double residual = 0.0;
};

/// Result of compare_velocities(): x y z of the translation, x y z of the rotation.
struct VelocityComparison {
  std::array<VelocityAgreement, 6> axes{};
  double turned_rad = 0.0;  ///< total rotation
  /// Correlation of reported and differenced angular velocity, over all axes; 1 is correct, -1 is an inverted
  /// sign. 0 if the handle did not rotate, or if the reported angular velocity is zero.
  double rotation_correlation = 0.0;
  /// The same if the four numbers of the quaternion are taken as w x y z.
  double w_first_correlation = 0.0;
};

/// Compares the reported velocities with the poses over windows of 20 ms:
///
///   mean of v over the window  =  (p_end - p_start) / duration
///   mean of w over the window  =  log(R_end R_start^T) / duration
///
/// The samples must follow each other without long gaps. Not RT-safe: intended for tools.
VelocityComparison compare_velocities(std::span<const MotionSample> samples);

/// Returns the rotation vector from one orientation to another, in the axes of B. The quaternions need not
/// have norm 1.
Vector3d turn_between(const Quaterniond& from, const Quaterniond& to);

/// Path length along and about an axis that is enough to judge its velocity.
struct Travel {
  double m = 0.0, rad = 0.0;
  double of(std::size_t axis) const { return axis < 3 ? m : rad; }
};

/// Path length that is enough while pulses move the handle, for a device with these steps of its numbers.
Travel least_travel_by_pulses(double step_m, double step_rad) noexcept;

/// Least rotation that is enough to judge the order of the quaternion.
inline constexpr double kMinTurn_rad = 0.2;

/// Judges the order of the quaternion by the reported angular velocity. Not RT-safe.
RuleFinding judge_quaternion_order(const VelocityComparison& seen);

/// Judges the sign, scale and axis of the reported velocity along these degrees of freedom, all linear or all
/// angular. Not RT-safe.
RuleFinding judge_velocity(const VelocityComparison& seen, DofMask axes, const Travel& enough);

}  // namespace wrenchd
