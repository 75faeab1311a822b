// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tools/view/min_max_history.hpp"

namespace wrenchd::test_min_max_history {

namespace {

constexpr std::int64_t kMs = 1'000'000;

ChannelValues all(double x) {
  ChannelValues values;
  values.fill(x);
  return values;
}

}  // namespace

TEST_CASE("a peak of one tick is in the bucket of its time", "[view]") {
  MinMaxHistory extremes(10 * kMs);
  for (int i = 0; i < 100; ++i) extremes.add(i * kMs, all(i == 37 ? 5.0 : i == 38 ? -4.0 : 1.0));
  REQUIRE(extremes.end_index() == 9);  // the tenth bucket is incomplete
  for (std::uint64_t k = 0; k < extremes.end_index(); ++k) {
    CHECK(extremes.at(k).begin_ns == static_cast<std::int64_t>(k) * 10 * kMs);
    for (std::size_t c = 0; c < kChannelCount; ++c) {
      CHECK(extremes.at(k).min[c] == (k == 3 ? -4.0 : 1.0));
      CHECK(extremes.at(k).max[c] == (k == 3 ? 5.0 : 1.0));
    }
  }
}

TEST_CASE("a bucket has a value if any of its ticks has one", "[view]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  MinMaxHistory extremes(10 * kMs);
  extremes.add(0, all(nan));
  extremes.add(1 * kMs, all(2.0));
  extremes.add(2 * kMs, all(nan));
  extremes.add(10 * kMs, all(nan));
  extremes.add(20 * kMs, all(0.0));
  REQUIRE(extremes.end_index() == 2);
  CHECK(extremes.at(0).min[0] == 2.0);
  CHECK(extremes.at(0).max[0] == 2.0);
  CHECK(std::isnan(extremes.at(1).max[0]));
}

TEST_CASE("old buckets are dropped, and indices are never reused", "[view]") {
  MinMaxHistory extremes(10 * kMs, 5);
  for (int i = 0; i <= 20; ++i) extremes.add(i * 10 * kMs, all(i));
  CHECK(extremes.first_index() == 15);
  CHECK(extremes.end_index() == 20);
  CHECK(extremes.at(15).max[0] == 15.0);
  CHECK(extremes.index_at(170 * kMs) == 17);
  CHECK(extremes.index_at(171 * kMs) == 18);
  CHECK(extremes.index_at(0) == 15);
  CHECK(extremes.index_at(1000 * kMs) == 20);

  extremes.add(0, all(-1.0));  // the clock has restarted
  extremes.add(10 * kMs, all(-2.0));
  CHECK(extremes.first_index() == 20);
  REQUIRE(extremes.end_index() == 21);
  CHECK(extremes.at(20).min[0] == -1.0);
}

}  // namespace wrenchd::test_min_max_history
