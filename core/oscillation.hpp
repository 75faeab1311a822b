// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/spatial.hpp"

namespace wrenchd {

/// Detects an unstable contact: a limit cycle of handle, spring and delay between 20 and 400 Hz
/// (core/METHOD.md, section 11.4).
///
/// Divides the handle motion along each of the six base axes into half-cycles between reversals. A half-cycle
/// counts if it lasts half a period of 20 to 400 Hz, has contact, at least min_amplitude_m and min_work_J,
/// and at least kMinAmplitudeRatio of the previous amplitude. kMinHalfCycles consecutive ones are an
/// oscillation. Detection takes 50 ms at 35 Hz and 90 ms at 20 Hz. RT-safe.
class OscillationDetector {
 public:
  struct Settings {
    /// least amplitude of a half-cycle: three steps of a coarse encoder; at 100 Hz a peak speed of 0.1 m/s
    double min_amplitude_m = 300e-6;
    /// converts a handle rotation to a displacement: distance from the handle centre to a fingertip
    double lever_m = 0.05;
    double min_work_J = 5.0e-6;  ///< least absolute work between motors and motion in a half-cycle
  };

  OscillationDetector() noexcept : OscillationDetector(Settings{}) {}
  explicit OscillationDetector(const Settings& settings) noexcept : settings_(settings) {}

  /// Adds a handle sample. F_B: wrench on the handle about the handle point; V_BH: twist of the handle; both
  /// in B. dt_s: time since the previous sample; a value that is not positive adds nothing. in_contact: true
  /// if a contact holds the tool. A half-cycle without contact does not count.
  void update(const Wrench& F_B, const Twist& V_BH, double dt_s, bool in_contact) noexcept;

  /// True from the detection until reset().
  bool oscillates() const noexcept { return oscillates_; }
  /// Discards all samples. Call it after a reaction to the oscillation.
  void reset() noexcept { *this = OscillationDetector(settings_); }

  static constexpr double kMinFrequency_Hz = 20.0;
  static constexpr double kMaxFrequency_Hz = 400.0;
  static constexpr double kMinAmplitudeRatio = 0.8;
  static constexpr int kMinHalfCycles = 2;

 private:
  /// Motion along one axis.
  struct Axis {
    double displacement_m = 0.0;  ///< displacement since the last reversal
    double peak_m = 0.0;          ///< farthest displacement since the last reversal
    double peak_time_s = 0.0;     ///< time of the farthest displacement since the last reversal
    double time_s = 0.0;          ///< time since the last reversal
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
