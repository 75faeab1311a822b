// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/link_watch.hpp"

#include <algorithm>

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

/// 20 ms of nothing but bad reports, or more than one in three for long: by time, so that it is the same at
/// every rate.
constexpr double kBucketFull_s = 0.040;
constexpr double kSlowest_Hz = 1000.0;
constexpr double kBad = 2.0;
constexpr double kGood = 1.0;
/// A device that reports seldom may be silent for as many of its periods.
constexpr double kLatePeriods = 3.0;
/// Two clocks may differ by so much: that is no lag.
constexpr double kClockDrift = 5e-4;

double lag_s(const DeviceSample& sample) noexcept {
  return seconds(sample.arrived.time_since_epoch()) - sample.device_time_s;
}

}  // namespace

LinkWatch::LinkWatch(double report_rate_Hz) noexcept
    : late_after_(report_rate_Hz > 0.0 ? std::max(kLateSample, from_seconds(kLatePeriods / report_rate_Hz))
                                       : kLateSample),
      bucket_capacity_(kBucketFull_s * (report_rate_Hz > kSlowest_Hz ? report_rate_Hz : kSlowest_Hz)) {}

FaultSet LinkWatch::check(const DeviceSample& sample, TimePoint now) noexcept {
  FaultSet found = 0;
  if (sample.rejected > sample.repeated) found |= bit(Fault::report_malformed);
  if (sample.repeated > 0) found |= bit(Fault::report_repeated);
  if (sample.missing > 0) found |= bit(Fault::report_missing);
  const bool first = !report_received_ && sample.fresh;
  report_received_ = report_received_ || sample.fresh;
  if (!report_received_) return found;
  if (first) {
    min_lag_s_ = lag_s(sample);
    min_lag_updated_ = sample.arrived;
  }
  const double bad = static_cast<double>(sample.rejected) + static_cast<double>(sample.missing);
  const double good = static_cast<double>(sample.superseded) + (sample.fresh ? 1.0 : 0.0);
  bucket_ = std::max(bucket_ + kBad * bad - kGood * good, 0.0);
  if (bucket_ > bucket_capacity_) {
    found |= bit(Fault::link_lossy);
    bucket_ = 0.0;  // told; what comes after somebody has looked counts anew
  }
  if (now - sample.arrived > late_after_ || lag_exceeded(sample)) found |= bit(Fault::sample_late);
  return found;
}

/// Reports that wait somewhere are old, however evenly they come. The shortest lag that was seen counts as
/// none.
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
