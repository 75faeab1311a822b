// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>

#include "core/device_profile.hpp"

namespace wrenchd {

/// Joint angles [rad], the driven ones first.
using JointAngles = std::array<double, kMaxJoints>;
/// One number a report integer: what the encoders count, before any scale.
using JointCounts = std::array<double, kMaxJoints>;
/// One number a motor, in what the device's efforts are counted in.
using MotorEfforts = std::array<double, kMaxMotors>;

// Encoders to pose, and force to motors, for devices that leave both to the host. D = the device's own base
// axes, E = its end: for these devices the point where the axes of the wrist meet. Everything is RT safe.
//
// capstan_arm (WoodenHaptics, Polhem 1). Body a turns about the vertical by tA, bodies b and c lean out by tB
// and tC from it; each motor stays where it is, so tC is an angle in space and not one between b and c.
// Lengths a, b, c; the facts are those of github.com/forsslund/haptikfabrikenapi, src/kinematics.cpp.
//
//   r = b sin tB + c sin tC
//   p_DE = [ r cos tA,  r sin tA,  a + b cos tB - c cos tC ] - origin
//   R_DE = Rz(tA) Ry(pi/2 - tC) Rx(tD) Ry(tE) Rx(tF)         with three more encoders, else 1
//
// delta (Novint Falcon): Stamper's three legs with parallelograms. Leg i stands at the angle phi_i about z;
// in its own axes u (outward), v (along the hinge), w = z. Letters and numbers are those of
// github.com/libnifalcon/libnifalcon, FalconGeometry.h and FalconKinematicStamper.cpp.
//
//   u = x cos phi + y sin phi - r
//   v = y cos phi - x sin phi - s
//   rho = d + e + sqrt(b^2 - (v + f)^2)
//   (u + c - a cos t)^2 + (w - a sin t)^2 = rho^2            ties the angle t of the thigh to p_DE

/// Joint angles of what the encoders count.
JointAngles joint_angles(const Kinematics& kinematics, const JointCounts& counts) noexcept;
/// The counts, not rounded, at which the encoders stand for these angles.
JointCounts joint_counts(const Kinematics& kinematics, const JointAngles& angles) noexcept;

/// The counts without the button that hides in one of them; adds it to `buttons`.
JointCounts strip_count_button(const Kinematics& kinematics, JointCounts counts,
                               std::uint32_t& buttons) noexcept;

/// X_DE of joint angles. `near`: where E was last; the delta is solved from there by Newton's method. Empty
/// where no position belongs to these angles: an encoder that lies.
std::optional<Pose> forward_kinematics(const Kinematics& kinematics, const JointAngles& angles,
                                       const Pose& near) noexcept;

/// Angles that hold E at X_DE: of the two the one with the elbow as the device is built. What the joints
/// cannot do (the orientation, without a wrist) is left out. Empty out of reach.
std::optional<JointAngles> inverse(const Kinematics& kinematics, const Pose& X_DE) noexcept;

/// dp_DE / dt of the driven joints, in D [m/rad]. `angles` and `X_DE` belong together.
Matrix3d jacobian(const Kinematics& kinematics, const JointAngles& angles, const Pose& X_DE) noexcept;

/// What the motors are told for a force on the hand at E, in D [N]:
///
///   tau = J' f,   effort_i = effort_per_Nm_i tau_i,   all cut by one factor to max_effort
MotorEfforts motor_efforts(const Kinematics& kinematics, const Matrix3d& J, const Vector3d& force_N) noexcept;
/// The torques about the joints that efforts make [N.m].
Vector3d joint_torques(const Kinematics& kinematics, const MotorEfforts& efforts) noexcept;

/// E at the home position: what the encoders say there is in the profile.
std::optional<Pose> home_pose(const Kinematics& kinematics) noexcept;

}  // namespace wrenchd
