// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Looks at how reports come: bad, missing, late by our clock and by the device's. RT safe.
class LinkWatch {
 public:
  /// report_rate_Hz: the profile's; not a number where it states none.
  explicit LinkWatch(double report_rate_Hz) noexcept;

  FaultSet check(const DeviceSample& sample, TimePoint now) noexcept;
  /// The next report is the first one.
  void reset() noexcept;

 private:
  bool lag_exceeded(const DeviceSample& sample) noexcept;

  Duration late_after_;
  double bucket_capacity_;
  double bucket_ = 0.0;  ///< 2 in for a bad or missing report, 1 out for a good one
  bool report_received_ = false;
  double min_lag_s_ = 0.0;  ///< of arrival behind the device's own clock
  TimePoint min_lag_updated_{};
};

}  // namespace wrenchd
