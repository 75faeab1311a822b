// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/loop_measurement.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

void DurationStatistic::add(double x_s) noexcept {
  max_ = count_ == 0 ? x_s : std::max(max_, x_s);
  ++count_;
  const double from_mean = x_s - mean_;
  mean_ += from_mean / static_cast<double>(count_);
  sum_squares_ += from_mean * (x_s - mean_);
  const double bin = std::max(0.0, x_s) / kBin_s;
  if (bin < static_cast<double>(kBins)) ++bins_[static_cast<std::size_t>(bin)];
}

double DurationStatistic::sd_s() const noexcept {
  return count_ < 2 ? 0.0 : std::sqrt(sum_squares_ / static_cast<double>(count_ - 1));
}

double DurationStatistic::quantile_s(double share) const noexcept {
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t counted = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    counted += bins_[i];
    if (counted >= wanted) return std::min(max_, static_cast<double>(i + 1) * kBin_s);
  }
  return max_;
}

void LoopMeasurement::tick(const TickTimes& times) noexcept {
  if (ticks_++ > 0) period_.add(seconds(times.now - last_tick_));
  last_tick_ = times.now;
  if (times.new_report) {
    if (reports_++ == 0) {
      first_arrival_ = times.arrived;
      first_sequence_ = times.sequence;
      first_device_s_ = times.device_time_s;
    }
    last_arrival_ = times.arrived;
    last_sequence_ = times.sequence;
    last_device_s_ = times.device_time_s;
    if (times.has_acknowledgement) update_round_trip(times);
  }
  if (reports_ > 0) age_.add(seconds(times.now - last_arrival_));
  sent_[times.sent % kMaxPending] = {times.sent, times.now};
  last_sent_ = times.sent;
}

/// A lost command is acknowledged together with the one after it. The device acts on neither before that, so
/// the round trip counts from the oldest newly acknowledged command: the longest.
void LoopMeasurement::update_round_trip(const TickTimes& times) noexcept {
  const std::uint64_t before = last_acknowledged_;
  if (times.acknowledged == before && has_acknowledgement_) return;
  last_acknowledged_ = times.acknowledged;
  if (!has_acknowledgement_) {  // age of the first acknowledged command is unknown
    has_acknowledgement_ = true;
    return;
  }
  if (last_acknowledged_ < before ||
      last_acknowledged_ > last_sent_) {  // the device restarted or sent an invalid number: start again
    has_acknowledgement_ = false;
    return;
  }
  if (last_acknowledged_ - before > kMaxPending) return;
  const Sent& oldest = sent_[(before + 1) % kMaxPending];
  if (oldest.number == before + 1 && oldest.at <= times.arrived)
    round_trip_.add(seconds(times.arrived - oldest.at));
}

double LoopMeasurement::report_rate_Hz() const noexcept {
  const double span_s = seconds(last_arrival_ - first_arrival_);
  return span_s > 0.0 ? static_cast<double>(last_sequence_ - first_sequence_) / span_s : 0.0;
}

double LoopMeasurement::device_clock_rate() const noexcept {
  const double span_s = seconds(last_arrival_ - first_arrival_);
  return span_s > 0.0 ? (last_device_s_ - first_device_s_) / span_s : 1.0;
}

double LoopMeasurement::missed_report_fraction() const noexcept {
  const double made = static_cast<double>(last_sequence_ - first_sequence_);
  return made > 0.0 ? 1.0 - static_cast<double>(reports_ - 1) / made : 0.0;
}

double LoopMeasurement::typical_delay_s() const noexcept {
  const double rate_Hz = report_rate_Hz();
  const double wait_s = delay_measured() && rate_Hz > 0.0 ? 0.5 / rate_Hz : 0.0;
  return std::max(0.0,
                  age_.mean_s() + (delay_measured() ? round_trip_.mean_s() : assumed_round_trip_s_) - wait_s);
}

double LoopMeasurement::delay_s() const noexcept {
  return age_.quantile_s(kQuantile) +
         (delay_measured() ? round_trip_.quantile_s(kQuantile) : assumed_round_trip_s_);
}

}  // namespace wrenchd
