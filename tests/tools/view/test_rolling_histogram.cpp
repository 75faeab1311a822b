// SPDX-License-Identifier: GPL-3.0-or-later
#include <numeric>

#include <catch2/catch.hpp>

#include "tools/view/rolling_histogram.hpp"

namespace wrenchd::test_rolling_histogram {

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace

TEST_CASE("times are counted in bins of equal width in the logarithm", "[view]") {
  RollingHistogram times;
  for (int i = 0; i < 999; ++i) times.add(i, 10'500);  // just above 10 us
  times.add(1'000, 3'000'000);
  times.add(1'001, 0);             // shorter than the first bin
  times.add(1'002, 20 * kSecond);  // longer than the last bin
  const RollingHistogram::Summary sum = times.summary();
  CHECK(sum.count == 1002);
  CHECK(std::accumulate(sum.bins.begin(), sum.bins.end(), std::uint64_t{0}) == 1002);
  CHECK(sum.bins[12] == 999);
  CHECK(sum.bins[41] == 1);
  CHECK(RollingHistogram::lower_edge_us(41) < 3000.0);
  CHECK(RollingHistogram::lower_edge_us(42) > 3000.0);
  CHECK(sum.bins[0] == 1);
  CHECK(sum.bins[RollingHistogram::kBins - 1] == 1);
  CHECK(sum.max_us == Approx(2e7));
}

TEST_CASE("quantiles are never too low, and at most 2.5 % too high", "[view]") {
  RollingHistogram times;
  for (int i = 1; i <= 10'000; ++i) times.add(i, i * 100);  // 0.1 us to 1 ms
  const RollingHistogram::Summary sum = times.summary();
  CHECK(sum.p50_us >= 500.0);
  CHECK(sum.p50_us <= 500.0 * 1.025);
  CHECK(sum.p99_9_us >= 999.0);
  CHECK(sum.p99_9_us <= 1000.0);  // clamped to the maximum
  CHECK(RollingHistogram().summary().count == 0);
}

TEST_CASE("durations older than ten seconds are dropped", "[view]") {
  RollingHistogram times;
  times.add(1 * kSecond, 50'000'000);
  for (int s = 2; s <= 10; ++s) times.add(s * kSecond, 20'000);
  CHECK(times.summary().count == 10);
  CHECK(times.summary().max_us == Approx(50'000.0));
  times.add(11 * kSecond, 20'000);
  CHECK(times.summary().count == 10);
  CHECK(times.summary().max_us == Approx(20.0));
  times.add(60 * kSecond, 20'000);
  CHECK(times.summary().count == 1);
  times.add(3 * kSecond, 30'000);  // from another daemon, whose clock has restarted
  CHECK(times.summary().count == 1);
  CHECK(times.summary().max_us == Approx(30.0));
}

}  // namespace wrenchd::test_rolling_histogram
