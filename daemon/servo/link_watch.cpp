// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/link_watch.hpp"

#include <algorithm>

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

/// The bucket fills after 20 ms of bad reports only, or if more than one report in three is bad for long. The
/// capacity is a time, so that the reaction is the same at every report rate.
constexpr double kBucketFull_s = 0.040;
constexpr double kMinBucketRate_Hz = 1000.0;
constexpr double kBadWeight = 2.0;
constexpr double kGoodWeight = 1.0;
/// A device with slow reports is late after this number of report periods.
constexpr double kLatePeriods = 3.0;
/// Relative rate difference of two clocks that does not count as lag.
constexpr double kClockDrift = 5e-4;

double lag_s(const DeviceSample& sample) noexcept {
  return seconds(sample.arrived.time_since_epoch()) - sample.device_time_s;
}

}  // namespace

LinkWatch::LinkWatch(double report_rate_Hz) noexcept
    : late_after_(report_rate_Hz > 0.0 ? std::max(kLateSample, from_seconds(kLatePeriods / report_rate_Hz))
                                       : kLateSample),
      bucket_capacity_(kBucketFull_s *
                       (report_rate_Hz > kMinBucketRate_Hz ? report_rate_Hz : kMinBucketRate_Hz)) {}

FaultSet LinkWatch::check(const DeviceSample& sample, TimePoint now) noexcept {
  FaultSet faults = 0;
  if (sample.rejected > sample.repeated) faults |= bit(Fault::report_malformed);
  if (sample.repeated > 0) faults |= bit(Fault::report_repeated);
  if (sample.missing > 0) faults |= bit(Fault::report_missing);
  const bool first = !report_received_ && sample.fresh;
  report_received_ = report_received_ || sample.fresh;
  if (!report_received_) return faults;
  if (first) {
    min_lag_s_ = lag_s(sample);
    min_lag_updated_ = sample.arrived;
  }
  const double bad = static_cast<double>(sample.rejected) + static_cast<double>(sample.missing);
  const double good = static_cast<double>(sample.superseded) + (sample.fresh ? 1.0 : 0.0);
  bucket_ = std::max(bucket_ + kBadWeight * bad - kGoodWeight * good, 0.0);
  if (bucket_ > bucket_capacity_) {
    faults |= bit(Fault::link_lossy);
    bucket_ = 0.0;  // the fault is raised once; later losses count from zero
  }
  if (now - sample.arrived > late_after_ || lag_exceeded(sample)) faults |= bit(Fault::sample_late);
  return faults;
}

/// Reports that wait in a queue arrive evenly but are old. The smallest lag so far is the reference.
bool LinkWatch::lag_exceeded(const DeviceSample& sample) noexcept {
  const double lag = lag_s(sample);
  min_lag_s_ = std::min(lag, min_lag_s_ + kClockDrift * seconds(sample.arrived - min_lag_updated_));
  min_lag_updated_ = sample.arrived;
  return lag - min_lag_s_ > seconds(late_after_);
}

void LinkWatch::reset() noexcept {
  bucket_ = 0.0;
  report_received_ = false;
}

}  // namespace wrenchd
