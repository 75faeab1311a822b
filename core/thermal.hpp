// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

struct DeviceProfile;

/// How warm the motors are that make one group, force or torque, as a share of what they bear for ever:
///
///   dh/dt = ((|F| / continuous)^2 - h) / T          the copper's I^2 R, and one time constant
///
/// From cold, full force F takes it to 1 in  t = -T ln(1 - (continuous / F)^2).  There it folds back: the
/// ceiling goes down to the continuous rating, so fast that the heat stays below kMaxHeat, and comes back as
/// it went when the heat has fallen to kRecoveryHeat. In between it stays where it is, so nothing chatters.
class MotorGroupHeat {
 public:
  static constexpr double kMaxHeat = 1.05;
  static constexpr double kRecoveryHeat = 0.8;

  /// Any of the three ratings not stated, or no less than the maximum: the ceiling is the maximum for ever.
  MotorGroupHeat(double maximum, double continuous, double thermal_time_s) noexcept;

  /// `pushed`: |F| over the last dt_s; more than the maximum, or not finite, counts as the maximum. RT safe.
  void advance(double pushed, double dt_s) noexcept;

  /// Another maximum from here on; the motors are as warm as they were. RT safe.
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
  double fold_time_s_ = 0.0;  ///< from the maximum to the rating, and back
  double heat_ = 0.0;
  double ceiling_;
  bool folded_ = false;
};

/// The motors of a device, which may give more for a while than for ever. Knows what was pushed, not what the
/// windings measure: it starts cold, so a device that was warm before has to be watched by its own firmware.
class ThermalModel {
 public:
  /// The maxima are those that hold, the configuration's where they are tighter.
  ThermalModel(const DeviceProfile& profile, double max_force_N, double max_torque_Nm) noexcept;

  /// F: what went out for the last dt_s. Time that does not pass, or runs backwards, warms nothing. RT safe.
  void advance(const Wrench& F, double dt_s) noexcept;

  /// As at construction, for maxima that are changed. RT safe.
  void set_maxima(double max_force_N, double max_torque_Nm) noexcept {
    force_.set_maximum(max_force_N);
    torque_.set_maximum(max_torque_Nm);
  }

  /// For WrenchLimits::set_ceiling, at the next tick.
  double force_ceiling_N() const noexcept { return force_.ceiling(); }
  double torque_ceiling_Nm() const noexcept { return torque_.ceiling(); }

  /// Shares of what the motors bear for ever; 0 where no rating is stated.
  double force_heat() const noexcept { return force_.heat(); }
  double torque_heat() const noexcept { return torque_.heat(); }
  bool folded_back() const noexcept { return force_.folded_back() || torque_.folded_back(); }

 private:
  MotorGroupHeat force_;
  MotorGroupHeat torque_;
};

}  // namespace wrenchd
