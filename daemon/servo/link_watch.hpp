// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Detects rejected, repeated and missing reports, and samples that are late by the host's or the device's
/// clock.
class LinkWatch {
 public:
  /// report_rate_Hz: rate of the profile; NaN if not stated. RT-safe.
  explicit LinkWatch(double report_rate_Hz) noexcept;

  /// Returns the faults of this sample. Call once per tick. RT-safe.
  FaultSet check(const DeviceSample& sample, TimePoint now) noexcept;
  /// Resets the detector; the next report counts as the first one. RT-safe.
  void reset() noexcept;

 private:
  bool lag_exceeded(const DeviceSample& sample) noexcept;

  Duration late_after_;           ///< Age from which a sample is late.
  double bucket_capacity_;        ///< Level from which the link is lossy.
  double bucket_ = 0.0;           ///< Leaky bucket: +2 for a bad or missing report, -1 for a good report.
  bool report_received_ = false;  ///< True after the first report.
  double min_lag_s_ = 0.0;        ///< Smallest lag of arrival time behind device time, plus clock drift.
  TimePoint min_lag_updated_{};   ///< Arrival time of the sample that last updated min_lag_s_.
};

}  // namespace wrenchd
