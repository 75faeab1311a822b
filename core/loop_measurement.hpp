// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/clock.hpp"

namespace wrenchd {

/// Mean, standard deviation, maximum and quantiles of durations, in fixed memory. RT-safe.
class DurationStatistic {
 public:
  void add(double x_s) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  double mean_s() const noexcept { return mean_; }
  double sd_s() const noexcept;  ///< standard deviation; 0 for fewer than two values
  double max_s() const noexcept { return max_; }
  /// Duration that the given share (0 to 1) of all values does not exceed, rounded up by at most kBin_s. 0 if
  /// there are no values.
  double quantile_s(double share) const noexcept;

  static constexpr double kBin_s = 25e-6;
  /// covers 20 ms; for longer values quantile_s() returns the maximum
  static constexpr std::size_t kBins = 800;

 private:
  std::uint64_t count_ = 0;
  double mean_ = 0.0;
  double sum_squares_ = 0.0;  ///< sum of squared distances from the mean (Welford 1962)
  double max_ = 0.0;
  std::array<std::uint32_t, kBins> bins_{};
};

/// Times of one tick.
struct TickTimes {
  TimePoint now{};                   ///< start of the tick
  TimePoint arrived{};               ///< arrival of the newest report at the host
  double device_time_s = 0.0;        ///< device time of the newest report, unwrapped
  std::uint64_t sequence = 0;        ///< sequence number of the newest report, unwrapped
  bool new_report = false;           ///< the newest report arrived after the previous tick
  bool has_acknowledgement = false;  ///< the device acknowledges commands
  std::uint64_t acknowledged = 0;    ///< number of the newest acknowledged command, unwrapped like `sent`
  std::uint64_t sent = 0;            ///< number of the command that this tick sends; increases
};

/// Measures the rate and delay of the servo loop. Both decide how stiff a wall may be
/// (core/stability_bound.hpp). Fixed memory. RT-safe.
class LoopMeasurement {
 public:
  /// assumed_s: delay from the pose sample to the motors, without the age of the report at the tick, for a
  /// device that acknowledges nothing. Two report periods are a safe guess: report and command travel once
  /// each, and the device handles each at most once per report.
  explicit LoopMeasurement(double assumed_s) noexcept : assumed_round_trip_s_(assumed_s) {}

  void tick(const TickTimes& times) noexcept;
  void reset() noexcept { *this = LoopMeasurement(assumed_round_trip_s_); }

  const DurationStatistic& period_s() const noexcept { return period_; }  ///< time between two ticks
  const DurationStatistic& age_s() const noexcept { return age_; }  ///< age of the pose sample at the tick
  /// Time from sending a command to the arrival of the first report that acknowledges it.
  const DurationStatistic& round_trip_s() const noexcept { return round_trip_; }
  /// Reports per second, lost ones included: sequence numbers over arrival time. 0 before the second report.
  double report_rate_Hz() const noexcept;
  /// Ratio of device clock to host clock. The wrench law differentiates by device time. 1 if both agree or
  /// before the second report.
  double device_clock_rate() const noexcept;
  /// Share of reports that were lost or superseded within a tick, 0 to 1. Only the newest report of a tick
  /// counts as received.
  double missed_report_fraction() const noexcept;

  /// Delay tau from the pose sample to the motors: kQuantile quantile of the age plus that of the round trip.
  /// The round trip includes the wait for the device's next report, so tau errs to the safe side by at most
  /// one report.
  double delay_s() const noexcept;
  /// Mean delay without half a report period, the device's mean wait. The passivity guard uses it to find the
  /// tick in which a wrench acts.
  double typical_delay_s() const noexcept;
  /// True if the delay is measured, false if it is assumed.
  bool delay_measured() const noexcept { return round_trip_.count() > 0; }
  /// loop period T: kQuantile quantile of the tick period
  double longest_period_s() const noexcept { return period_.quantile_s(kQuantile); }

  /// Includes one lost report or command if every twentieth is lost. Excludes the rare tick that is tens of
  /// milliseconds late on a machine without a real-time kernel: it would forbid any stiffness, and it
  /// interrupts the soft start anyway.
  static constexpr double kQuantile = 0.99;

 private:
  void update_round_trip(const TickTimes& times) noexcept;

  /// Maximum number of commands whose acknowledgement is pending. A device that is 64 ticks behind
  /// acknowledges none.
  static constexpr std::size_t kMaxPending = 64;
  struct Sent {
    std::uint64_t number = 0;
    TimePoint at{};
  };

  double assumed_round_trip_s_;
  DurationStatistic period_, age_, round_trip_;
  std::array<Sent, kMaxPending> sent_{};
  std::uint64_t last_sent_ = 0;          ///< number of the last command sent; 0: none
  std::uint64_t last_acknowledged_ = 0;  ///< number of the newest acknowledged command
  bool has_acknowledgement_ = false;     ///< true after the first acknowledgement
  std::uint64_t ticks_ = 0, reports_ = 0;
  TimePoint last_tick_{}, first_arrival_{}, last_arrival_{};
  std::uint64_t first_sequence_ = 0, last_sequence_ = 0;
  double first_device_s_ = 0.0, last_device_s_ = 0.0;
};

}  // namespace wrenchd
