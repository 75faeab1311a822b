// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>

#include "core/device_profile.hpp"

namespace wrenchd {

/// Joint angles [rad], the driven joints first.
using JointAngles = std::array<double, kMaxJoints>;
/// Encoder counts, one per integer of the report, before any scaling.
using JointCounts = std::array<double, kMaxJoints>;
/// Motor efforts, one per motor, in the unit of the efforts of the profile.
using MotorEfforts = std::array<double, kMaxMotors>;

// Encoder counts to pose, and force to motor efforts, for devices without kinematics of their own. D = the
// device's own frame, E = its end frame; its origin is the intersection of the wrist axes. All functions are
// RT-safe.
//
// capstan_arm (WoodenHaptics, Polhem 1). Body a rotates about the vertical by tA. Bodies b and c tilt by tB
// and tC from the vertical. All motors are fixed to body a, so tC is an angle in space and not an angle
// between b and c. Lengths a, b, c. Source: github.com/forsslund/haptikfabrikenapi, src/kinematics.cpp.
//
//   r = b sin tB + c sin tC
//   p_DE = [ r cos tA,  r sin tA,  a + b cos tB - c cos tC ] - origin
//   R_DE = Rz(tA) Ry(pi/2 - tC) Rx(tD) Ry(tE) Rx(tF)         with three more encoders, else 1
//
// delta (Novint Falcon): Stamper's three legs with parallelograms. Leg i is at the angle phi_i about z. Its
// own axes are u (outward), v (along the hinge), w = z. Symbols as in github.com/libnifalcon/libnifalcon,
// FalconGeometry.h and FalconKinematicStamper.cpp.
//
//   u = x cos phi + y sin phi - r
//   v = y cos phi - x sin phi - s
//   rho = d + e + sqrt(b^2 - (v + f)^2)
//   (u + c - a cos t)^2 + (w - a sin t)^2 = rho^2            relates the thigh angle t to p_DE

/// Returns the joint angles of encoder counts. RT-safe.
JointAngles joint_angles(const Kinematics& kinematics, const JointCounts& counts) noexcept;
/// Returns the encoder counts of joint angles, not rounded. RT-safe.
JointCounts joint_counts(const Kinematics& kinematics, const JointAngles& angles) noexcept;

/// Returns the counts without the offset of a button that is coded in one of them, and sets the button in
/// `buttons`. RT-safe.
JointCounts strip_count_button(const Kinematics& kinematics, JointCounts counts,
                               std::uint32_t& buttons) noexcept;

/// Returns X_DE of joint angles. `near`: initial guess for the Newton iteration of the delta, the previous
/// pose of E. Empty if no pose exists for these angles, for example after an encoder error. RT-safe.
std::optional<Pose> forward_kinematics(const Kinematics& kinematics, const JointAngles& angles,
                                       const Pose& near) noexcept;

/// Returns the joint angles at which E is at X_DE. Of the two solutions, returns the one with the elbow of
/// the real device. Without a wrist, ignores the orientation. Empty if X_DE is out of reach. RT-safe.
std::optional<JointAngles> inverse(const Kinematics& kinematics, const Pose& X_DE) noexcept;

/// Returns dp_DE / dt of the driven joints, in D [m/rad]. X_DE must be the pose of `angles`. RT-safe.
Matrix3d jacobian(const Kinematics& kinematics, const JointAngles& angles, const Pose& X_DE) noexcept;

/// Returns the motor efforts for a force on the hand at E, in D [N]:
///
///   tau = J' f,   effort_i = effort_per_Nm_i tau_i,   all scaled by one factor to at most max_effort
///
/// RT-safe.
MotorEfforts motor_efforts(const Kinematics& kinematics, const Matrix3d& J, const Vector3d& force_N) noexcept;
/// Returns the joint torques of motor efforts [N.m]. RT-safe.
Vector3d joint_torques(const Kinematics& kinematics, const MotorEfforts& efforts) noexcept;

/// Returns X_DE at the home position; the profile has its encoder counts. RT-safe.
std::optional<Pose> home_pose(const Kinematics& kinematics) noexcept;

}  // namespace wrenchd
