// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/spatial.hpp"
#include "core/stability_bound.hpp"

namespace wrenchd {

/// How much the guard may do, and when what it sends shows. Constant after start.
struct PassivityLimits {
  /// Damping that the guard may add, at most. Beyond what the device's own friction is, delay makes a damper
  /// push (core/stability_bound.hpp); so this is never more than that, whatever is set here.
  double damping_N_s_per_m = 1e9;
  double damping_Nm_s_per_rad = 1e9;
  /// Up to here nothing is cut: what an encoder of 100 um cannot tell at 10 N, F times half a step.
  double scaling_start_J = 0.5e-3;
  /// From here on nothing of the wrench is left. Between the two the share that is left falls evenly.
  double scaling_end_J = 2.0e-3;
  /// Ticks from a wrench to the sample interval in which it shows, 0 where it is the next sample's: the
  /// typical delay over the period (core/loop_measurement.hpp).
  std::size_t delay_ticks = 1;
};

/// A time-domain passivity observer and controller in six degrees of freedom (after Hannaford and Ryu 2002),
/// for what the bound on stiffness cannot see: laws that are not a gradient, a delay that grows, a damping
/// that was measured too high.
///
///   E <- E + F . dx + tau . dtheta - (b |v|^2 + b_rot |w|^2) dt      what the loop gave, net of the device
///
/// with F the wrench that really acted over the interval dx. Wrenches that are sent and have not acted yet
/// cannot be called back: what they will do if the handle goes on as it does is counted in, for the guard's
/// decisions only. While a spring is pressed E is negative, and as
/// it is let go E comes back to 0: that is its right. Above 0 is energy from nowhere. Then, in contact, the
/// guard damps,
///
///   F_guard = -alpha (b v, b_rot w)       alpha = E / (what alpha = 1 takes in a tick), at most the cap
///
/// and from unseen_J on it cuts the wrench itself: a softer spring, and where nothing is left, none. It is
/// the cut that stops a law which keeps on giving; capped damping cannot.
///
/// Without contact what is left below 0 is forgotten, so that nothing earned in one contact pays for another;
/// what is above 0 falls by what the device's friction takes, and by a milliwatt: a law that once gave too
/// much must not leave a hand that rests on the wall without any. b |v|^2 is taken over kVelocityWindow
/// samples, which is never more than the truth for a smooth motion and keeps the steps of an encoder from
/// counting as speed.
///
/// B = device base, H = handle point. Everything but construction is RT safe.
class PassivityGuard {
 public:
  /// Damping not stated counts as 0: nothing is forgiven. Throws std::invalid_argument where a number is
  /// negative or not finite, unseen_J is not below most_J, or the delay is longer than kMaxDelay_ticks.
  PassivityGuard(const DeviceDamping& device, const PassivityLimits& caps);

  /// The wrench that may go out for the one asked for: on the hand, about the handle point, in B. X_BH: the
  /// newest sample. dt_s: its device time since the sample of the last call; 0 where it is the same. A pose
  /// or a wrench that is not finite is handed on as it is, for the limits to stop.
  Wrench limit(const Wrench& asked_B, const Pose& X_BH, double dt_s, bool in_contact) noexcept;

  /// Energy that the loop may give from here on, because its spring was wound up while nobody looked: a wall
  /// that rises around a hand which is in it.
  void credit(double energy_J) noexcept { net_J_ -= energy_J > 0.0 ? energy_J : 0.0; }

  /// The same by obstacles that move against the hand; and what those that move away take out of the spring
  /// (below 0) the hand has no right to any more. Taking makes no debt: it was not the loop that gave.
  void credit_obstacle_work(double energy_J) noexcept {
    if (energy_J > 0.0) return credit(energy_J);
    if (net_J_ < 0.0) net_J_ = net_J_ - energy_J < 0.0 ? net_J_ - energy_J : 0.0;
  }

  /// What really went out this tick, after the limits. Without it the guard takes what it gave for sent.
  void record_sent(const Wrench& sent_B) noexcept;

  /// Work since the last reset(), never falling [J]: of the hand on the loop, and of the loop on the hand.
  double energy_in_J() const noexcept { return energy_in_J_; }
  double energy_out_J() const noexcept { return energy_out_J_; }
  /// E of above where it is positive: what came from nowhere and is not yet taken back [J].
  double injected_J() const noexcept { return net_J_ > 0.0 ? net_J_ : 0.0; }
  /// Did the last guard() change the wrench?
  bool intervened() const noexcept { return intervened_; }
  /// The share of the wrench that it left, 0 to 1.
  double scale() const noexcept { return scale_; }
  /// More than kRunawayEnergy_J came from nowhere within kRunawayWindow_s: a fault.
  bool energy_runaway() const noexcept { return energy_runaway_; }

  /// Forgets everything: no wrench is under way, and the next sample begins a motion.
  void reset() noexcept;

  static constexpr std::size_t kMaxDelay_ticks = 48;
  static constexpr std::size_t kVelocityWindow = 8;
  static constexpr double kEnergyLeak_W = 1e-3;
  static constexpr double kRunawayEnergy_J = 20e-3;
  static constexpr double kRunawayWindow_s = 0.100;

 private:
  struct Motion {
    Vector3d displacement_m = Vector3d::Zero();
    Vector3d rotation_rad = Vector3d::Zero();
    double dt_s = 0.0;
  };
  static constexpr std::size_t kSentHistory = 64;    ///< ticks of wrenches kept
  static constexpr std::size_t kRunawaySlices = 10;  ///< of kRunawayWindow_s

  void observe(const Motion& step) noexcept;
  Wrench acting_wrench() const noexcept;
  double pending_work_J() const noexcept;
  double device_dissipation_J(double dt_s) const noexcept;
  bool no_wrench_pending() const noexcept;
  void check_energy_runaway(double dt_s) noexcept;
  Wrench damping_wrench(double dt_s) const noexcept;

  DeviceDamping device_;
  PassivityLimits limits_;
  double max_alpha_ = 0.0;

  std::array<Wrench, kSentHistory> sent_{};  ///< by tick, newest at tick_
  std::uint64_t tick_ = 0;
  std::size_t ticks_since_sample_ = 0;  ///< since the last new sample
  bool has_pose_ = false;
  Pose X_BH_;
  std::array<Motion, kVelocityWindow> motion_{};  ///< newest at steps_
  std::uint64_t steps_ = 0;
  Motion window_motion_;  ///< their sum

  double net_J_ = 0.0;
  double energy_in_J_ = 0.0, energy_out_J_ = 0.0;
  double scale_ = 1.0;
  double predicted_net_J_ = 0.0;  ///< net_J_ once what is under way has acted
  bool intervened_ = false;
  bool energy_runaway_ = false;
  std::array<double, kRunawaySlices> min_injected_J_{};  ///< of injected_J(), by slice
  std::size_t slice_ = 0;
  double slice_time_s_ = 0.0;
};

}  // namespace wrenchd
