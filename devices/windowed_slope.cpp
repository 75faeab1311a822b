// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/windowed_slope.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Shortest time between two stored samples, so that kMaxIntervals of them span the longest window at every
/// report rate. A newer sample replaces the newest stored one.
constexpr double kMinSpacing_s =
    WindowedSlope::kMaxWindow_s / static_cast<double>(WindowedSlope::kMaxIntervals);
/// Rounding error of sums of times.
constexpr double kTimeRounding_s = 1e-9;

}  // namespace

Vector3d WindowedSlope::update(double t_s, const Vector3d& x) noexcept {
  if (count_ > 0 && t_s - samples_[count_ - 1].t_s > kMaxWindow_s + kTimeRounding_s) reset();
  if (count_ == 0 || t_s > samples_[count_ - 1].t_s) {
    watch_changes(x);
    add({t_s, x});
  }
  std::size_t old = 0;
  while (t_s - samples_[old].t_s > kMaxWindow_s + kTimeRounding_s) ++old;
  drop_oldest(old);
  window_s_ = 0.0;
  if (count_ < 2) return Vector3d::Zero();
  std::size_t first = 0;
  Line line = fit(first);
  while (!line.fits && count_ - first > kMinIntervals + 1) line = fit(++first);
  drop_oldest(first);
  window_s_ = samples_[count_ - 1].t_s - samples_[0].t_s;
  return at_rest() ? Vector3d(Vector3d::Zero()) : line.slope;
}

void WindowedSlope::watch_changes(const Vector3d& x) noexcept {
  constexpr double kSame = 1e-3;  // in steps: rounding of sums
  if (count_ == 0) return;
  const Vector3d last = samples_[count_ - 1].x;
  if ((x - last).norm() <= kSame * step_) return;
  toggles_ = has_changed_ && (x - before_change_).norm() <= kSame * step_;
  before_change_ = last;
  has_changed_ = true;
}

bool WindowedSlope::at_rest() const noexcept {
  if (!toggles_) return false;
  constexpr double kRounding = 1.0 + 1e-6;
  const double step = kRounding * step_;
  for (std::size_t i = 0; i + 1 < count_; ++i)
    if ((samples_[i].x - samples_[count_ - 1].x).squaredNorm() > step * step) return false;
  return true;
}

/// The newest sample is always stored. It takes the place of its predecessor if that one is nearer to the
/// sample before it than kMinSpacing_s.
void WindowedSlope::add(const Sample& sample) noexcept {
  const bool replaces =
      count_ >= 2 && samples_[count_ - 1].t_s - samples_[count_ - 2].t_s < kMinSpacing_s - kTimeRounding_s;
  if (replaces) --count_;
  if (count_ == samples_.size()) drop_oldest(1);
  samples_[count_++] = sample;
}

void WindowedSlope::drop_oldest(std::size_t many) noexcept {
  if (many == 0) return;
  std::copy(samples_.begin() + static_cast<std::ptrdiff_t>(many),
            samples_.begin() + static_cast<std::ptrdiff_t>(count_), samples_.begin());
  count_ -= many;
}

/// Times and values are relative to the newest sample, so that no precision is lost after days.
WindowedSlope::Line WindowedSlope::fit(std::size_t first) const noexcept {
  const Sample& newest = samples_[count_ - 1];
  const auto n = static_cast<double>(count_ - first);
  double t_mean_s = 0.0;
  Vector3d x_mean = Vector3d::Zero();
  for (std::size_t i = first; i < count_; ++i) {
    t_mean_s += (samples_[i].t_s - newest.t_s) / n;
    x_mean += (samples_[i].x - newest.x) / n;
  }
  double tt = 0.0;
  Vector3d tx = Vector3d::Zero();
  for (std::size_t i = first; i < count_; ++i) {
    const double t_s = samples_[i].t_s - newest.t_s - t_mean_s;
    tt += t_s * t_s;
    tx += t_s * (samples_[i].x - newest.x - x_mean);
  }
  Line line{tx / tt, true};
  const double tolerance = step_ + time_error_s_ * line.slope.norm();
  for (std::size_t i = first; i < count_ && line.fits; ++i) {
    const double t_s = samples_[i].t_s - newest.t_s - t_mean_s;
    line.fits = (samples_[i].x - newest.x - x_mean - t_s * line.slope).squaredNorm() <= tolerance * tolerance;
  }
  return line;
}

}  // namespace wrenchd
