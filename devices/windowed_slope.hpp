// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

#include "core/pose.hpp"

namespace wrenchd {

/// Slope of a sampled, quantized vector signal: best-fit first-order adaptive windowing after Janabi-Sharifi,
/// Hayward and Chen (2000), with a window that never grows into the past.
///
///   slope = sum (t_i - t_mean) (x_i - x_mean) / sum (t_i - t_mean)^2        over the window
///
/// The window is the longest one whose samples all lie within one step of their best-fit line. It holds at
/// most kMaxWindow_s and at least kMinIntervals intervals, and no sample older than the start of the previous
/// window. Slow motion is averaged over the whole window; fast changes shorten it. If the signal returns to
/// the value before its last change and stays within one step, the slope is zero: an encoder that toggles on
/// the edge of a count does not move.
///
/// The slope is a weighted mean of the velocities in the window, with weights of sum 1 and none negative, or
/// zero. Its delay at constant acceleration is half the window. Rounding to a step s, over n intervals of h,
/// gives a standard deviation of s / (h sqrt(n (n+1) (n+2))) and an error of at most 1.5 s / (n h);
/// core/METHOD.md, section 10.6. All members are RT-safe.
class WindowedSlope {
 public:
  static constexpr double kMaxWindow_s = 0.016;
  static constexpr std::size_t kMaxIntervals = 32;
  static constexpr std::size_t kMinIntervals = 2;

  /// step: largest distance of a sample from the line that rounding explains. time_error_s: largest error of
  /// the times, 0 if they are exact.
  explicit WindowedSlope(double step, double time_error_s = 0.0) noexcept
      : step_(step), time_error_s_(time_error_s) {}

  /// Adds a sample and returns the slope. Returns zero for the first sample, and for the first one after a
  /// gap longer than kMaxWindow_s. Ignores a sample whose time does not increase.
  Vector3d update(double t_s, const Vector3d& x) noexcept;
  void reset() noexcept {
    count_ = 0;
    has_changed_ = toggles_ = false;
  }

  /// Length of the window of the last slope; its delay is half of it [s].
  double window_s() const noexcept { return window_s_; }

 private:
  struct Sample {
    double t_s = 0.0;
    Vector3d x = Vector3d::Zero();
  };
  struct Line {
    Vector3d slope = Vector3d::Zero();
    bool fits = false;  ///< all samples are within the tolerance
  };

  void add(const Sample& sample) noexcept;
  void drop_oldest(std::size_t many) noexcept;
  void watch_changes(const Vector3d& x) noexcept;
  bool at_rest() const noexcept;
  /// Best-fit line through the samples from index `first` on.
  Line fit(std::size_t first) const noexcept;

  double step_;
  double time_error_s_;
  std::array<Sample, kMaxIntervals + 1> samples_{};  ///< oldest first
  std::size_t count_ = 0;
  double window_s_ = 0.0;
  Vector3d before_change_ = Vector3d::Zero();  ///< value before the last change, if has_changed_
  bool has_changed_ = false;
  bool toggles_ = false;  ///< the last change led back to the value before the previous change
};

}  // namespace wrenchd
