// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/clock.hpp"

namespace wrenchd {

/// Mean, spread, maximum and quantiles of durations, without keeping each. RT safe.
class DurationStatistic {
 public:
  void add(double x_s) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  double mean_s() const noexcept { return mean_; }
  double sd_s() const noexcept;  ///< 0 for fewer than two
  double max_s() const noexcept { return max_; }
  /// What this share of them does not exceed, 0 to 1, rounded up by at most kBin_s; 0 where there are none.
  double quantile_s(double share) const noexcept;

  static constexpr double kBin_s = 25e-6;
  static constexpr std::size_t kBins = 800;  ///< 20 ms; what is longer is answered with the maximum

 private:
  std::uint64_t count_ = 0;
  double mean_ = 0.0;
  double sum_squares_ = 0.0;  ///< of the distances from the mean (Welford 1962)
  double max_ = 0.0;
  std::array<std::uint32_t, kBins> bins_{};
};

/// What one tick of the loop tells of its own times.
struct TickTimes {
  TimePoint now{};                   ///< when the tick began
  TimePoint arrived{};               ///< when the newest report reached the host
  double device_time_s = 0.0;        ///< of that report, unwrapped
  std::uint64_t sequence = 0;        ///< of that report, unwrapped
  bool new_report = false;           ///< it came since the last tick
  bool has_acknowledgement = false;  ///< the device says which commands it took
  std::uint64_t acknowledged = 0;    ///< the newest command it took, unwrapped as the next
  std::uint64_t sent = 0;            ///< the number of the command that this tick sends; counts up
};

/// The servo loop's rate and delay, as they are and not as they were planned: the numbers that decide how
/// stiff a wall may be (core/stability_bound.hpp). Fixed memory; everything is RT safe.
class LoopMeasurement {
 public:
  /// assumed_s: the longest time from a sample of a pose to the motors that push by it, beyond the report's
  /// age at the tick, for a device that acknowledges nothing. Report and command have to travel, and the
  /// device looks at neither more often than it reports: two periods of its reports are a careful guess.
  explicit LoopMeasurement(double assumed_s) noexcept : assumed_round_trip_s_(assumed_s) {}

  void tick(const TickTimes& times) noexcept;
  void reset() noexcept { *this = LoopMeasurement(assumed_round_trip_s_); }

  const DurationStatistic& period_s() const noexcept { return period_; }  ///< from tick to tick
  const DurationStatistic& age_s() const noexcept { return age_; }        ///< of the sample at the tick
  /// From sending a command to the first report that acknowledges it reaching the host.
  const DurationStatistic& round_trip_s() const noexcept { return round_trip_; }
  /// Reports made a second, lost ones included: sequence over arrival time. 0 before the second report.
  double report_rate_Hz() const noexcept;
  /// The same of the device's clock against ours, by which the wrench law differentiates: 1 where they agree.
  double device_clock_rate() const noexcept;
  /// Share of the reports that did not come, 0 to 1. A tick drains several; only the newest is seen here, so
  /// this counts those too.
  double missed_report_fraction() const noexcept;

  /// tau, from the sample of a pose to the motors that push by it: the age plus the round trip, each as long
  /// as kQuantile of them are at most. The device's wait between taking a command and its next report is in
  /// the round trip though it is not in tau, so this errs to the safe side by up to one report.
  double delay_s() const noexcept;
  /// The same on the average, without the device's wait, half a report: by which the passivity guard tells
  /// which wrench acted when.
  double typical_delay_s() const noexcept;
  /// Is the delay of a round trip that was seen, and not assumed?
  bool delay_measured() const noexcept { return round_trip_.count() > 0; }
  double longest_period_s() const noexcept { return period_.quantile_s(kQuantile); }  ///< T, likewise

  /// A share that takes in one lost report or command where every twentieth is lost, and leaves out the rare
  /// tick that a machine without real-time kernel is late by tens of milliseconds: that one would forbid any
  /// stiffness, and interrupts the soft start anyway.
  static constexpr double kQuantile = 0.99;

 private:
  void update_round_trip(const TickTimes& times) noexcept;

  /// Commands whose acknowledgement is awaited. One that is older, 64 ticks, is a device that takes none.
  static constexpr std::size_t kMaxPending = 64;
  struct Sent {
    std::uint64_t number = 0;
    TimePoint at{};
  };

  double assumed_round_trip_s_;
  DurationStatistic period_, age_, round_trip_;
  std::array<Sent, kMaxPending> sent_{};
  std::uint64_t last_sent_ = 0;          ///< the last number; 0: none
  std::uint64_t last_acknowledged_ = 0;  ///< the newest acknowledged
  bool has_acknowledgement_ = false;     ///< of any acknowledgement
  std::uint64_t ticks_ = 0, reports_ = 0;
  TimePoint last_tick_{}, first_arrival_{}, last_arrival_{};
  std::uint64_t first_sequence_ = 0, last_sequence_ = 0;
  double first_device_s_ = 0.0, last_device_s_ = 0.0;
};

}  // namespace wrenchd
