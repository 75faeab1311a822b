// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// How far the motors are let go.
enum class Engagement : std::uint8_t {
  disarmed,  ///< zero wrench, motors off: after every start
  waiting,   ///< armed, but the hand is fast or would be pushed: zero wrench until it is calm
  ramping,   ///< authority rises from 0 to 1
  active,    ///< full authority
};

const char* name(Engagement state) noexcept;

/// The way from disarmed to full authority, without a kick: armed, calm for a moment, then a ramp. Anything
/// that breaks the loop's continuity (a late tick, a stale sample) goes back to waiting. No clock, no I/O. RT
/// safe.
class SoftStart {
 public:
  explicit SoftStart(double ramp_s) : ramp_s_(ramp_s) {}

  void arm() noexcept;
  void disarm() noexcept;
  /// Authority drops to zero at once; an armed loop starts again from waiting.
  void interrupt() noexcept;

  /// One tick further. calm: the handle is slow and the wrench that full authority would give is small.
  /// Returns the authority, 0 to 1, for this tick.
  double advance(bool calm, double dt_s) noexcept;

  Engagement state() const noexcept { return state_; }

 private:
  double ramp_s_;
  Engagement state_ = Engagement::disarmed;
  double elapsed_s_ = 0.0;  ///< in this state
};

/// What "calm" means: slow enough that no push can surprise, and the push itself small.
inline constexpr double kCalmSpeed_m_per_s = 0.05;
inline constexpr double kCalmAngularSpeed_rad_per_s = 0.5;
inline constexpr double kCalmShareOfLimit = 0.10;
inline constexpr double kCalmFor_s = 0.100;

}  // namespace wrenchd
