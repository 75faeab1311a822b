// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "devices/conformance/reported_velocity.hpp"
#include "devices/conformance/rule_result.hpp"

namespace wrenchd {

/// Largest force and torque of a pulse, whatever the profile permits.
inline constexpr double kMaxPulse_N = 0.5;
inline constexpr double kMaxPulse_Nm = 0.02;

/// Force and torque of the pulses for a device of this profile: at most kMaxPulse_N and kMaxPulse_Nm, and at
/// most a twentieth of the limits of the profile.
double pulse_force_N(const DeviceProfile& profile) noexcept;
double pulse_torque_Nm(const DeviceProfile& profile) noexcept;

/// Device that pulses drive.
class PulsedDevice {
 public:
  virtual ~PulsedDevice() = default;
  /// Exerts F on the hand about H, in B, with the motors on, for this time. Returns the valid samples that
  /// arrived in it, the oldest first.
  virtual std::vector<MotionSample> drive(Duration time, const Wrench& F) = 0;
};

/// Number and durations of the pulses along one axis.
struct PulsePace {
  int pulses;           ///< least number; more, up to a limit, if the response is not significant
  Duration pulse;       ///< each half of a pulse
  Duration after_axis;  ///< time after the pulses, in which the handle comes to rest
};

inline constexpr PulsePace kThoroughPulses = {6, std::chrono::milliseconds(40),
                                              std::chrono::milliseconds(100)};
inline constexpr PulsePace kBriefPulses = {3, std::chrono::milliseconds(30), std::chrono::milliseconds(30)};

/// Checks the sign and the axis of the force and torque of a device: applies short pulses of both signs along
/// each axis in turn and observes the displacement of the handle. The difference of the two displacements
/// does not contain a steady motion of the hand.
///
/// A right device does positive work on a handle that is free or held loosely. Its response matrix A, with
/// d_i = A_ij F_j, has a positive diagonal. Where a pulse moves the handle more along another axis, as an arm
/// with unequal masses does, A must be symmetric and positive definite in these two axes; a swapped or turned
/// frame is not. Not RT-safe: takes some 100 ms for each axis.
class DirectionPulses {
 public:
  /// The device must outlive this object.
  DirectionPulses(PulsedDevice& device, const PulsePace& pace) : device_(device), pace_(pace) {}

  /// Judges the force along `axes`, the linear degrees of freedom that are driven and sensed. least_m: least
  /// displacement that is not a step of the encoders. Throws as PulsedDevice::drive() does, and
  /// std::runtime_error if the device sends no valid sample.
  RuleFinding judge_force(double pulse_N, DofMask axes, double least_m);
  /// The same for the torque about `axes`, the angular degrees of freedom.
  RuleFinding judge_torque(double pulse_Nm, DofMask axes, double least_rad);

  /// Samples during all pulses.
  std::span<const MotionSample> motion() const noexcept { return motion_; }

 private:
  /// Mean displacement of the handle by pulses along one axis.
  struct Response {
    bool force = true;  ///< true for a force and a displacement, false for a torque and a rotation
    int pulses = 0;
    bool stopped = false;  ///< the handle moved too far
    Vector3d mean = Vector3d::Zero();
    Vector3d error = Vector3d::Zero();  ///< standard error of the mean
    double least = 0.0;                 ///< least displacement that counts

    void average(const std::vector<Vector3d>& moved);
    bool is_significant(int axis) const;
    int strongest_axis() const;
    std::string text(int axis) const;
  };
  using Responses = std::array<Response, 3>;

  RuleFinding judge(bool force, double size, DofMask axes, double least);
  Response apply(bool force, int axis, double size, double least);
  Vector3d displacement(bool force, const Wrench& F);
  /// Drives the device and keeps its last pose in X_BH_.
  std::vector<MotionSample> drive(Duration time, const Wrench& F);
  /// Returns what is wrong with the response along an axis; "" if nothing is.
  static std::string error_of(const Responses& responses, DofMask axes, int axis);
  static bool is_coupling(const Responses& responses, DofMask axes, int axis, int strongest);

  PulsedDevice& device_;
  const PulsePace& pace_;
  std::optional<Pose> X_BH_;  ///< last known pose
  std::vector<MotionSample> motion_;
};

}  // namespace wrenchd
