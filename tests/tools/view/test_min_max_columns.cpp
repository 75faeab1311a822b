// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tools/view/min_max_columns.hpp"

namespace wrenchd::test_min_max_columns {

namespace {

constexpr std::int64_t kMs = 1'000'000;

MinMaxHistory::Bucket bucket(std::int64_t begin_ns, double low, double high) {
  MinMaxHistory::Bucket out;
  out.begin_ns = begin_ns;
  out.min.fill(low);
  out.max.fill(high);
  return out;
}

}  // namespace

TEST_CASE("no number of buckets gives more columns than requested, and no peak is lost", "[view]") {
  for (const std::int64_t ticks : {1, 2, 7, 99, 100, 101, 1'000, 34'567}) {
    for (const std::int64_t origin : {std::int64_t{0}, 12'345 * kMs + 678}) {
      const std::int64_t peak = ticks * 2 / 3;
      MinMaxColumns columns(origin, origin + (ticks - 1) * kMs, 100);
      for (std::int64_t i = 0; i < ticks; ++i)
        columns.add(bucket(origin + i * kMs, i == peak ? -7.0 : 0.0, i == peak ? 9.0 : 1.0));
      const auto& out = columns.columns();
      CHECK(out.size() <= 100);
      CHECK(out.front().begin_ns == origin);
      double low = 0.0, high = 0.0;
      for (const auto& one : out) low = std::min(low, one.min[3]), high = std::max(high, one.max[3]);
      CHECK(low == -7.0);
      CHECK(high == 9.0);
      CHECK(std::is_sorted(out.begin(), out.end(),
                           [](const auto& a, const auto& b) { return a.begin_ns < b.begin_ns; }));
    }
  }
}

TEST_CASE("few ticks have a column each, with their own times", "[view]") {
  MinMaxColumns columns(0, 9 * kMs, 500);
  for (std::int64_t i = 0; i < 10; ++i)
    columns.add(bucket(i * kMs + 3, static_cast<double>(i), static_cast<double>(i)));
  REQUIRE(columns.columns().size() == 9);  // the last one is later than the range
  for (std::size_t i = 0; i < 9; ++i) {
    CHECK(columns.columns()[i].begin_ns == static_cast<std::int64_t>(i) * kMs + 3);
    CHECK(columns.columns()[i].max[0] == static_cast<double>(i));
  }
}

TEST_CASE("columns keep their borders while the range moves", "[view]") {
  const auto borders = [](std::int64_t from_ns) {
    MinMaxColumns columns(from_ns, from_ns + 1'000 * kMs, 51);
    for (std::int64_t i = 0; i < 4'000; ++i) columns.add(bucket(i * kMs, 0.0, 0.0));
    std::vector<std::int64_t> out;
    for (const auto& one : columns.columns()) out.push_back(one.begin_ns);
    return out;
  };
  const auto first = borders(1'000 * kMs), later = borders(1'500 * kMs);
  std::size_t both = 0;
  for (const std::int64_t border : later)
    both += std::find(first.begin(), first.end(), border) != first.end();
  CHECK(both >= 24);  // half of the range is in both
}

TEST_CASE("values outside of the range and gaps make no column", "[view]") {
  MinMaxColumns columns(100 * kMs, 200 * kMs, 11);
  for (const std::int64_t ms : {50, 111, 112, 190, 250}) columns.add(bucket(ms * kMs, 1.0, 2.0));
  CHECK(columns.columns().size() == 2);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  MinMaxColumns partly(0, 100 * kMs, 2);
  partly.add(bucket(0, nan, nan));
  partly.add(bucket(kMs, 3.0, 4.0));
  REQUIRE(partly.columns().size() == 1);
  CHECK(partly.columns()[0].min[0] == 3.0);
  CHECK(partly.columns()[0].max[0] == 4.0);
}

TEST_CASE("a range of no length has one column", "[view]") {
  MinMaxColumns columns(5, 5, 0);
  columns.add(bucket(5, 1.0, 1.0));
  CHECK(columns.columns().size() == 1);
}

}  // namespace wrenchd::test_min_max_columns
