// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/spatial.hpp"

namespace wrenchd {

/// Sees a contact that swings by itself: a limit cycle of handle, spring and delay, between 20 and 400 Hz.
///
/// Along each of the six axes of the base the way of the handle is cut into swings, from one turning point to
/// the next. A swing counts that takes between half a period of 400 Hz and half a period of 20 Hz, is `way_m`
/// long or more (about an axis: turn times lever), kept kKept of the one before, and exchanged `work_J` with
/// the motors. kMinHalfCycles of them in a row are an oscillation. As the blow that begins it is longer than
/// what follows, that takes three swings and the beginning of a fourth: 50 ms at 35 Hz, 90 ms at 20 Hz. Fewer
/// would take the rebound of a tap for one.
///
/// So a hand's tremor (up to 12 Hz) is too slow, a hard tap that bounces loses more than a fifth of its way
/// each time, what slides over the faces of a mesh moves across the force and not to and fro, and what swings
/// without the motors is the hand's own business. Everything is RT safe.
class OscillationDetector {
 public:
  struct Settings {
    double min_amplitude_m = 300e-6;  ///< three steps of a coarse encoder; at 100 Hz a peak of 0.1 m/s
    double lever_m = 0.05;       ///< that makes a turn of the handle a way: from its middle to a fingertip
    double min_work_J = 5.0e-6;  ///< of motors and motion, without sign, in one swing
  };

  OscillationDetector() noexcept : OscillationDetector(Settings{}) {}
  explicit OscillationDetector(const Settings& settings) noexcept : settings_(settings) {}

  /// A new sample of the handle. F_B: the wrench that acts on it, about the handle point; V_BH: its velocity;
  /// both in B. dt_s: since the last sample; not above 0: nothing has happened. in_contact: is the tool held
  /// off by anything? A swing without any contact does not count.
  void update(const Wrench& F_B, const Twist& V_BH, double dt_s, bool in_contact) noexcept;

  /// Stays until restart().
  bool oscillates() const noexcept { return oscillates_; }
  /// Forgets what was seen: what to call once something was done about it.
  void reset() noexcept { *this = OscillationDetector(settings_); }

  static constexpr double kMinFrequency_Hz = 20.0;
  static constexpr double kMaxFrequency_Hz = 400.0;
  static constexpr double kMinAmplitudeRatio = 0.8;
  static constexpr int kMinHalfCycles = 2;

 private:
  /// The motion along one axis.
  struct Axis {
    double displacement_m = 0.0;  ///< since the last turning point
    double peak_m = 0.0;          ///< of it
    double peak_time_s = 0.0;     ///< when it was there, since the last turning point
    double time_s = 0.0;          ///< since then
    double work_J = 0.0;
    bool had_contact = false;
    double last_amplitude_m = 0.0;
    int half_cycles = 0;
  };
  void advance(Axis& axis, double step_m, double work_J, double dt_s, bool in_contact) const noexcept;
  void end_half_cycle(Axis& axis) const noexcept;

  Settings settings_;
  std::array<Axis, 6> axes_{};
  bool oscillates_ = false;
};

}  // namespace wrenchd
