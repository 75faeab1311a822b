// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tools/view/min_max_history.hpp"

using namespace wrenchd;

namespace {

constexpr std::int64_t kMs = 1'000'000;

ChannelValues all(double x) {
  ChannelValues values;
  values.fill(x);
  return values;
}

}  // namespace

TEST_CASE("a peak of one tick is in the stretch in which it was", "[view]") {
  Extremes extremes(10 * kMs);
  for (int i = 0; i < 100; ++i) extremes.add(i * kMs, all(i == 37 ? 5.0 : i == 38 ? -4.0 : 1.0));
  REQUIRE(extremes.end() == 9);  // the tenth still grows
  for (std::uint64_t k = 0; k < extremes.end(); ++k) {
    CHECK(extremes.at(k).begin_ns == static_cast<std::int64_t>(k) * 10 * kMs);
    for (std::size_t c = 0; c < kChannels; ++c) {
      CHECK(extremes.at(k).least[c] == (k == 3 ? -4.0 : 1.0));
      CHECK(extremes.at(k).most[c] == (k == 3 ? 5.0 : 1.0));
    }
  }
}

TEST_CASE("a stretch has a number where any tick of it has one", "[view]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Extremes extremes(10 * kMs);
  extremes.add(0, all(nan));
  extremes.add(1 * kMs, all(2.0));
  extremes.add(2 * kMs, all(nan));
  extremes.add(10 * kMs, all(nan));
  extremes.add(20 * kMs, all(0.0));
  REQUIRE(extremes.end() == 2);
  CHECK(extremes.at(0).least[0] == 2.0);
  CHECK(extremes.at(0).most[0] == 2.0);
  CHECK(std::isnan(extremes.at(1).most[0]));
}

TEST_CASE("old stretches are forgotten, and numbers are never used again", "[view]") {
  Extremes extremes(10 * kMs, 5);
  for (int i = 0; i <= 20; ++i) extremes.add(i * 10 * kMs, all(i));
  CHECK(extremes.first() == 15);
  CHECK(extremes.end() == 20);
  CHECK(extremes.at(15).most[0] == 15.0);
  CHECK(extremes.from(170 * kMs) == 17);
  CHECK(extremes.from(171 * kMs) == 18);
  CHECK(extremes.from(0) == 15);
  CHECK(extremes.from(1000 * kMs) == 20);

  extremes.add(0, all(-1.0));  // the clock began anew
  extremes.add(10 * kMs, all(-2.0));
  CHECK(extremes.first() == 20);
  REQUIRE(extremes.end() == 21);
  CHECK(extremes.at(20).least[0] == -1.0);
}
