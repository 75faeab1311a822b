// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/servo/loop_timing.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_loop_timing {

using namespace wrenchd::test;

TEST_CASE("quantiles are right within 3 %, the maximum exactly", "[timing]") {
  RandomValues random(1);
  DurationHistogram histogram;
  std::vector<std::int64_t> ns;
  for (int i = 0; i < 20000; ++i) {
    ns.push_back(static_cast<std::int64_t>(random.log_uniform(1.0, 1e10)));
    histogram.add(Duration(ns.back()));
  }
  std::sort(ns.begin(), ns.end());
  CHECK(histogram.count() == ns.size());
  CHECK(histogram.max().count() == ns.back());
  for (const double fraction : {0.001, 0.1, 0.5, 0.9, 0.99, 0.999}) {
    const auto exact = static_cast<double>(ns[static_cast<std::size_t>(fraction * 20000.0) - 1]);
    const auto quantile_ns = static_cast<double>(histogram.quantile(fraction).count());
    CHECK(quantile_ns >= exact);
    CHECK(quantile_ns <= exact * 1.032 + 1.0);
  }
}

TEST_CASE("an empty histogram, and zero, negative and unlimited durations, have defined results",
          "[timing]") {
  DurationHistogram histogram;
  CHECK(histogram.quantile(0.5) == Duration(0));
  CHECK(histogram.max() == Duration(0));
  histogram.add(Duration(-5));
  CHECK(histogram.quantile(1.0) == Duration(0));
  histogram.add(Duration::max());
  CHECK(histogram.max() == Duration::max());
  CHECK(histogram.quantile(1.0) > std::chrono::minutes(15));
}

}  // namespace wrenchd::test_loop_timing
