// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "core/loop_measurement.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_loop_measurement {

using test::RandomValues;

namespace {

using std::chrono::microseconds;

constexpr Duration kMillisecond = microseconds(1000);

/// A device that reports every millisecond, with a transport delay of 200 us in each direction. A report
/// acknowledges commands that arrived before its sample. The host ticks 300 us after each report.
struct Link {
  std::uint64_t lag = 1;  ///< ticks between a command and the report that acknowledges it
  bool acknowledges = true;
  std::uint64_t first = 1;  ///< number of the first command
  Duration epoch = kMillisecond * 5;

  TickTimes tick(std::uint64_t n) const {
    TickTimes t;
    t.now = TimePoint{} + epoch + static_cast<long>(n) * kMillisecond;
    t.arrived = t.now - microseconds(300);
    t.device_time_s = 1e-3 * static_cast<double>(n);
    t.sequence = 100 + n;
    t.new_report = true;
    t.has_acknowledgement = acknowledges;
    t.sent = first + n;
    t.acknowledged = n >= lag ? first + n - lag : 0;
    return t;
  }
};

}  // namespace

TEST_CASE("the measurement of a steady loop is exact", "[loop_measurement]") {
  LoopMeasurement measured(0.009);
  const Link link;
  for (std::uint64_t n = 0; n < 1000; ++n) measured.tick(link.tick(n));
  CHECK(measured.period_s().mean_s() == Approx(1e-3));
  CHECK(measured.period_s().sd_s() == Approx(0.0).margin(1e-12));
  CHECK(measured.longest_period_s() == Approx(1e-3).margin(1e-12));
  CHECK(measured.report_rate_Hz() == Approx(1000.0));
  CHECK(measured.device_clock_rate() == Approx(1.0));
  CHECK(measured.missed_report_fraction() == Approx(0.0).margin(1e-12));
  CHECK(measured.age_s().mean_s() == Approx(0.3e-3));
  REQUIRE(measured.delay_measured());
  // Sent at n, acknowledged by the report that came 0.7 ms later.
  CHECK(measured.round_trip_s().mean_s() == Approx(0.7e-3));
  CHECK(measured.delay_s() == Approx(1.0e-3));
  CHECK(measured.typical_delay_s() == Approx(0.5e-3));  // the device waited for half a report period
}

TEST_CASE("the round trip belongs to the acknowledged command, for any number of pending commands",
          "[loop_measurement]") {
  for (const std::uint64_t lag : {1u, 2u, 5u, 40u}) {
    LoopMeasurement measured(0.0);
    Link link;
    link.lag = lag;
    for (std::uint64_t n = 0; n < 500; ++n) measured.tick(link.tick(n));
    INFO("lag " << lag);
    CHECK(measured.round_trip_s().max_s() == Approx(1e-3 * static_cast<double>(lag) - 0.3e-3));
  }
}

TEST_CASE("a lost report increases the sample age, a lost command the round trip", "[loop_measurement]") {
  LoopMeasurement measured(0.0);
  const Link link;
  for (std::uint64_t n = 0; n < 1000; ++n) {
    TickTimes t = link.tick(n);
    if (n % 20 == 10) {  // this tick has no report
      t.new_report = false;
      t.arrived = link.tick(n - 1).arrived;
      t.sequence = link.tick(n - 1).sequence;
      t.acknowledged = link.tick(n - 1).acknowledged;
    }
    if (n % 20 == 5) t.acknowledged -= 1;  // the previous command was lost
    measured.tick(t);
  }
  CHECK(measured.age_s().max_s() == Approx(1.3e-3));
  CHECK(measured.missed_report_fraction() == Approx(0.05).margin(2e-3));
  CHECK(measured.report_rate_Hz() == Approx(1000.0));  // lost reports count for the rate
  CHECK(measured.round_trip_s().max_s() == Approx(1.7e-3));
  CHECK(measured.delay_s() == Approx(3.0e-3).margin(DurationStatistic::kBin_s * 2));
}

TEST_CASE("one late tick in a thousand does not change the result, one in twenty does",
          "[loop_measurement]") {
  for (const std::uint64_t every : {1000u, 20u}) {
    LoopMeasurement measured(0.0);
    const Link link;
    for (std::uint64_t n = 1; n < 4000; ++n) {
      TickTimes t = link.tick(n);
      if (n % every == 0) t.now += microseconds(600);
      measured.tick(t);
    }
    INFO("every " << every);
    CHECK(measured.age_s().max_s() == Approx(0.9e-3));
    CHECK(measured.age_s().quantile_s(0.99) == Approx(every == 20 ? 0.9e-3 : 0.3e-3).margin(26e-6));
    CHECK(measured.period_s().max_s() == Approx(1.6e-3));
    CHECK(measured.longest_period_s() == Approx(every == 20 ? 1.6e-3 : 1.0e-3).margin(26e-6));
  }
}

TEST_CASE("without acknowledgements the assumed delay is used and marked as assumed", "[loop_measurement]") {
  LoopMeasurement measured(2e-3);
  Link link;
  link.acknowledges = false;
  for (std::uint64_t n = 0; n < 100; ++n) measured.tick(link.tick(n));
  CHECK_FALSE(measured.delay_measured());
  CHECK(measured.delay_s() == Approx(2.3e-3));
  CHECK(measured.typical_delay_s() == Approx(2.3e-3));
}

TEST_CASE("restarts and invalid acknowledgements do not change the measurement", "[loop_measurement]") {
  LoopMeasurement measured(2e-3);
  Link link;
  for (std::uint64_t n = 0; n < 100; ++n) {
    TickTimes t = link.tick(n);
    if (n == 50) t.acknowledged = 1'000'000;  // never sent
    if (n == 60) t.acknowledged = 0;          // backward
    measured.tick(t);
  }
  CHECK(measured.round_trip_s().max_s() == Approx(0.7e-3));
}

TEST_CASE("an empty measurement does not divide by zero", "[loop_measurement]") {
  LoopMeasurement measured(2e-3);
  CHECK(measured.report_rate_Hz() == 0.0);
  CHECK(measured.device_clock_rate() == 1.0);
  CHECK(measured.missed_report_fraction() == 0.0);
  CHECK(measured.delay_s() == 2e-3);
  measured.tick(Link{}.tick(0));
  CHECK(measured.report_rate_Hz() == 0.0);
  measured.tick(Link{}.tick(1));
  measured.reset();
  CHECK(measured.period_s().count() == 0);
}

TEST_CASE("the statistics of durations agree with those of the full list", "[loop_measurement]") {
  RandomValues random(5);
  DurationStatistic statistic;
  std::vector<double> list;
  for (int n = 0; n < 5000; ++n) {
    list.push_back(random.log_uniform(1e-6, 50e-3));  // some outside of the bins
    statistic.add(list.back());
  }
  std::sort(list.begin(), list.end());
  double mean = 0.0, squares = 0.0;
  for (const double x : list) mean += x / 5000.0;
  for (const double x : list) squares += (x - mean) * (x - mean) / 4999.0;
  CHECK(statistic.mean_s() == Approx(mean));
  CHECK(statistic.sd_s() == Approx(std::sqrt(squares)));
  CHECK(statistic.max_s() == list.back());
  for (const double share : {0.1, 0.5, 0.8}) {
    const double exact = list[static_cast<std::size_t>(share * 5000.0) - 1];
    CHECK(statistic.quantile_s(share) >= exact);
    CHECK(statistic.quantile_s(share) <= exact + DurationStatistic::kBin_s);
  }
  CHECK(statistic.quantile_s(0.999) == list.back());
  CHECK(DurationStatistic{}.quantile_s(0.99) == 0.0);
}

TEST_CASE("measuring allocates nothing", "[loop_measurement][rt]") {
  LoopMeasurement measured(2e-3);
  const Link link;
  const test::RealtimeGuard guard;
  for (std::uint64_t n = 0; n < 1000; ++n) measured.tick(link.tick(n));
  measured.reset();
  CHECK(guard.allocations() + guard.locks() == 0);
}

}  // namespace wrenchd::test_loop_measurement
