// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/spatial.hpp"
#include "core/stability_bound.hpp"

namespace wrenchd {

/// Limits of the guard's action and the delay of the loop. Constant after start.
struct PassivityLimits {
  /// Upper limit of the damping that the guard adds. The guard never exceeds the device's own friction: with
  /// delay, a larger damping would add energy (core/stability_bound.hpp).
  double damping_N_s_per_m = 1e9;
  double damping_Nm_s_per_rad = 1e9;
  /// Excess energy at which wrench scaling starts: F times half a step for 10 N and an encoder step of 100
  /// um.
  double scaling_start_J = 0.5e-3;
  /// Excess energy at which the wrench is scaled to 0. The scale is linear between scaling_start_J and
  /// scaling_end_J.
  double scaling_end_J = 2.0e-3;
  /// Ticks from sending a wrench to the sample interval in which it acts; 0: the interval of the next sample.
  /// Typical delay over period (core/loop_measurement.hpp).
  std::size_t delay_ticks = 1;
};

/// Time-domain passivity observer and controller in six degrees of freedom (after Hannaford and Ryu 2002;
/// core/METHOD.md, section 11). Covers what the stability bound does not: laws that are not a gradient, a
/// growing delay, and an overestimated damping. METHOD (84)-(87):
///
///   E <- E + F . dx + tau . dtheta - (b |v|^2 + b_rot |w|^2) dt      energy returned by the loop, net of
///   friction F_guard = -alpha (b v, b_rot w)                                  if E > 0 in contact; alpha is
///   clamped
///
/// From scaling_start_J on the guard also scales the wrench. Without contact it discards stored energy (E <
/// 0) and lets excess energy decay. B: device base, H: handle point. RT-safe, except construction.
class PassivityGuard {
 public:
  /// A damping that is not stated counts as 0. Throws std::invalid_argument if a number is negative or not
  /// finite, scaling_start_J is not below scaling_end_J, or the delay exceeds kMaxDelay_ticks.
  PassivityGuard(const DeviceDamping& device, const PassivityLimits& caps);

  /// Returns the permitted wrench for the requested one: on the hand, about the handle point, in B. X_BH:
  /// newest sample. dt_s: device time since the sample of the previous call; 0 for the same sample. Returns a
  /// wrench unchanged if any input is not finite; the limits reject it.
  Wrench limit(const Wrench& asked_B, const Pose& X_BH, double dt_s, bool in_contact) noexcept;

  /// Credits energy that the loop may return: the energy that its spring stores without handle motion, for
  /// example when an obstacle appears around the tool.
  void credit(double energy_J) noexcept { net_J_ -= energy_J > 0.0 ? energy_J : 0.0; }

  /// Credits the work of moving obstacles on the spring. A positive value adds to the energy that the loop
  /// may return. A negative value removes stored energy, at most down to E = 0.
  void credit_obstacle_work(double energy_J) noexcept {
    if (energy_J > 0.0) return credit(energy_J);
    if (net_J_ < 0.0) net_J_ = net_J_ - energy_J < 0.0 ? net_J_ - energy_J : 0.0;
  }

  /// Records the wrench sent in this tick, after the limits. Without this call the guard assumes that its own
  /// result was sent.
  void record_sent(const Wrench& sent_B) noexcept;

  /// Work since the last reset() [J], never decreasing: of the hand on the loop (in), of the loop on the hand
  /// (out).
  double energy_in_J() const noexcept { return energy_in_J_; }
  double energy_out_J() const noexcept { return energy_out_J_; }
  /// Excess energy: E if it is positive, otherwise 0 [J].
  double injected_J() const noexcept { return net_J_ > 0.0 ? net_J_ : 0.0; }
  /// True if the last limit() changed the wrench.
  bool intervened() const noexcept { return intervened_; }
  /// Scale of the last limit() on the wrench, 0 to 1.
  double scale() const noexcept { return scale_; }
  /// True if more than kRunawayEnergy_J of excess energy arose within kRunawayWindow_s; this is a fault.
  bool energy_runaway() const noexcept { return energy_runaway_; }

  /// Discards all energy, samples and pending wrenches.
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
  static constexpr std::size_t kSentHistory = 64;    ///< length of the wrench history in ticks
  static constexpr std::size_t kRunawaySlices = 10;  ///< number of slices of kRunawayWindow_s

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

  std::array<Wrench, kSentHistory> sent_{};  ///< wrench sent per tick, newest at tick_
  std::uint64_t tick_ = 0;
  std::size_t ticks_since_sample_ = 0;  ///< ticks since the last new sample
  bool has_pose_ = false;
  Pose X_BH_;
  std::array<Motion, kVelocityWindow> motion_{};  ///< sample intervals, newest at steps_
  std::uint64_t steps_ = 0;
  Motion window_motion_;  ///< sum of the intervals in motion_

  double net_J_ = 0.0;
  double energy_in_J_ = 0.0, energy_out_J_ = 0.0;
  double scale_ = 1.0;
  double predicted_net_J_ = 0.0;  ///< net_J_ plus the work of pending wrenches
  bool intervened_ = false;
  bool energy_runaway_ = false;
  std::array<double, kRunawaySlices> min_injected_J_{};  ///< minimum of injected_J() per slice
  std::size_t slice_ = 0;
  double slice_time_s_ = 0.0;
};

}  // namespace wrenchd
