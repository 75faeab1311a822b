// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

struct DeviceProfile;

/// Heat of a group of motors (force or torque), as a share of the continuous rating:
///
///   dh/dt = ((|F| / continuous)^2 - h) / T          I^2 R losses, one time constant
///
/// From cold, a constant F reaches h = 1 at t = -T ln(1 - (continuous / F)^2). Then the ceiling folds back to
/// the continuous rating, fast enough to keep the heat below kMaxHeat. Below kRecoveryHeat it rises again at
/// the same rate. Between the two heats the direction does not change.
class MotorGroupHeat {
 public:
  static constexpr double kMaxHeat = 1.05;
  static constexpr double kRecoveryHeat = 0.8;

  /// If a rating is not stated, or is not below the maximum, the ceiling is always the maximum.
  MotorGroupHeat(double maximum, double continuous, double thermal_time_s) noexcept;

  /// Advances the heat by dt_s at the effort `pushed` = |F|. A value above the maximum or not finite counts
  /// as the maximum. RT-safe.
  void advance(double pushed, double dt_s) noexcept;

  /// Replaces the maximum and keeps the heat. RT-safe.
  void set_maximum(double maximum) noexcept;

  double ceiling() const noexcept { return ceiling_; }
  double heat() const noexcept { return heat_; }
  bool folded_back() const noexcept { return folded_; }

 private:
  double max_next_ceiling() const noexcept;

  double maximum_;
  double continuous_;
  double time_s_;
  bool rated_;
  /// time in which the ceiling falls from the maximum to the rating, or rises back
  double fold_time_s_ = 0.0;
  double heat_ = 0.0;
  double ceiling_;
  bool folded_ = false;
};

/// Thermal model of a device's motors, which may exceed their continuous rating for a limited time. It
/// integrates the wrenches sent and does not measure the windings. It starts cold; the firmware must protect
/// motors that were warm before.
class ThermalModel {
 public:
  /// Maxima: the effective limits, the tighter of profile and configuration.
  ThermalModel(const DeviceProfile& profile, double max_force_N, double max_torque_Nm) noexcept;

  /// Advances the heat by dt_s with the wrench F sent during that time. A dt_s that is not positive changes
  /// nothing. RT-safe.
  void advance(const Wrench& F, double dt_s) noexcept;

  /// Replaces the maxima and keeps the heat. RT-safe.
  void set_maxima(double max_force_N, double max_torque_Nm) noexcept {
    force_.set_maximum(max_force_N);
    torque_.set_maximum(max_torque_Nm);
  }

  /// Force ceiling for WrenchLimits::set_ceiling() in the next tick.
  double force_ceiling_N() const noexcept { return force_.ceiling(); }
  double torque_ceiling_Nm() const noexcept { return torque_.ceiling(); }

  /// Heat of the force motors as a share of the continuous rating; 0 if no rating is stated.
  double force_heat() const noexcept { return force_.heat(); }
  double torque_heat() const noexcept { return torque_.heat(); }
  bool folded_back() const noexcept { return force_.folded_back() || torque_.folded_back(); }

 private:
  MotorGroupHeat force_;
  MotorGroupHeat torque_;
};

}  // namespace wrenchd
