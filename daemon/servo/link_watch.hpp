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

  FaultSet look(const DeviceSample& sample, TimePoint now) noexcept;
  /// The next report is the first one.
  void forget() noexcept;

 private:
  bool falls_behind(const DeviceSample& sample) noexcept;

  Duration late_after_;
  double bucket_holds_;
  double bucket_ = 0.0;  ///< 2 in for a bad or missing report, 1 out for a good one
  bool heard_ = false;
  double least_lag_s_ = 0.0;  ///< of arrival behind the device's own clock
  TimePoint lag_at_{};
};

}  // namespace wrenchd
