// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/limits.hpp"
#include "core/thermal.hpp"
#include "core/work_account.hpp"
#include "daemon/servo/authority.hpp"
#include "daemon/servo/contact_stabilizer.hpp"
#include "daemon/servo/renderer.hpp"
#include "daemon/servo/tick_clock.hpp"

namespace wrenchd {

/// Turns the demand into a wrench that may go out: passive, within magnitude, slew, power and heat. All
/// members but the constructor are RT-safe.
class OutputStage {
 public:
  /// bounds: of the first rendering. Not RT-safe: copies the profile's limits.
  OutputStage(const LimitSettings& settings, const DeviceProfile& profile, const EnergyBounds& bounds);

  /// Replaces passivity guard and account, after the delay of the loop was measured again.
  void set_bounds(const EnergyBounds& bounds) noexcept {
    stabilizer_.set_guard(bounds.guard);
    account_ = bounds.account;
  }
  /// Changes the limits. While the loop is armed, values looser than those that hold are ignored. Returns the
  /// limits that hold from now on, the profile's included.
  LimitSettings set_limits(const LimitSettings& limits, bool armed) noexcept;
  /// The limits that hold now, the profile's included.
  LimitSettings effective_limits() const noexcept;

  /// The contact wrench without energy that the contact generates by itself. state: that the supervisor
  /// expects for this tick.
  Stabilized stabilize(const Demand& demand, const DeviceSample& sample, State state) noexcept;
  /// The motors gave more than they can give continuously: their ceiling is lowered.
  bool overheated() const noexcept { return heat_.folded_back(); }
  /// The wrench to send: the stabilized wrench, the weight compensation and what the account allows of the
  /// external wrench, scaled by the authority, within every limit.
  Limited limit(const Stabilized& contact, const Demand& demand, const Authority& authority,
                const DeviceSample& sample, const TickTime& t) noexcept;
  /// The next wrench grows from zero.
  void reset() noexcept;

  double max_force_N() const noexcept { return limits_.max_force_N(); }
  double max_torque_Nm() const noexcept { return limits_.max_torque_Nm(); }
  /// How fast one wrench may fade into another.
  RenderingCrossfade::FadeLimits fade_limits() const noexcept {
    return {max_force_N(), max_torque_Nm(), settings_.soft_start_s};
  }
  /// Share of the contact wrench of the last tick that was sent, 0 to 1; 0 while the motors are off.
  double contact_share() const noexcept { return contact_share_; }
  const ContactStabilizer& stabilizer() const noexcept { return stabilizer_; }
  /// The external wrench that the last tick sent, and the energy that it may still give to the hand.
  struct External {
    Wrench F;
    double balance_J = 0.0;
  };
  External external() const noexcept { return {F_external_sent_, account_.balance_J()}; }

 private:
  Wrench permitted_external(const Demand& demand, const DeviceSample& sample, const TickTime& t) noexcept;

  const DeviceProfile& profile_;
  LimitSettings settings_;
  WrenchLimits limits_;
  ThermalModel heat_;
  ContactStabilizer stabilizer_;
  WorkAccount account_;                  ///< Bounds the work of the external wrench.
  Wrench F_external_sent_;               ///< External wrench that the last tick sent.
  double external_sample_time_s_ = 0.0;  ///< Device time of the account's last sample.
  double contact_share_ = 0.0;           ///< Sent contact wrench over the requested one, in the last tick.
  Twist V_BH_;                           ///< Last finite twist of the handle.
  Vector3d p_BH_m_ = Vector3d::Zero();   ///< Last finite position of the handle point.
};

}  // namespace wrenchd
