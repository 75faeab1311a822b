// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/recording/record_history.hpp"

namespace wrenchd::test_record_history {

namespace {

/// Returns tick i at i ms with this many contacts; each contact encodes its tick and index.
StateRecord record(std::uint64_t i, std::uint64_t contact_count) {
  StateRecord made;
  made.tick.tick = i;
  made.tick.now_ns = static_cast<std::int64_t>(i) * 1'000'000;
  made.contact_count = contact_count;
  for (std::uint64_t k = 0; k < contact_count; ++k)
    made.contacts[k].obstacle = static_cast<std::uint32_t>(100 * i + k);
  return made;
}

}  // namespace

TEST_CASE("the history holds the newest ticks with their contacts", "[recording]") {
  RecordHistory history(100);
  CHECK(history.newest_ns() == 0);
  RecordBatch batch;
  CHECK(history.copy(0, 1000, 10, batch) == 0);
  CHECK(batch.ticks.empty());
  for (std::uint64_t i = 0; i < 250; ++i) history.append(record(i, i % 4));
  CHECK(history.stored_range().begin == 150);
  CHECK(history.stored_range().end == 250);
  CHECK(history.newest_ns() == 249'000'000);
  CHECK(history.copy(0, 1000, 1000, batch) == 150);
  REQUIRE(batch.ticks.size() == 100);
  for (std::size_t k = 0; k < 100; ++k) {
    const std::uint64_t i = 150 + k;
    REQUIRE(batch.ticks[k].tick == i);
    REQUIRE(batch.contact_ranges[k].count == i % 4);
    for (std::size_t t = 0; t < i % 4; ++t)
      REQUIRE(batch.contacts[batch.contact_ranges[k].first + t].obstacle == 100 * i + t);
  }
  CHECK(history.copy(200, 1000, 7, batch) == 200);
  CHECK(batch.ticks.size() == 7);
  CHECK(history.copy(200, 203, 7, batch) == 200);
  CHECK(batch.ticks.size() == 3);
  for (std::int64_t i = 150; i < 250; ++i) {
    REQUIRE(history.first_at_or_after(i * 1'000'000) == static_cast<std::uint64_t>(i));
    REQUIRE(history.first_at_or_after(i * 1'000'000 - 500'000) == static_cast<std::uint64_t>(i));
  }
  CHECK(history.first_at_or_after(0) == 150);
  CHECK(history.first_at_or_after(1'000'000'000) == 250);
}

TEST_CASE(
    "if contacts exceed the memory, the contacts of the oldest ticks are dropped first and the ticks stay",
    "[recording]") {
  RecordHistory history(100);
  for (std::uint64_t i = 0; i < 100; ++i) history.append(record(i, kMaxTouches));
  RecordBatch batch;
  history.copy(0, 100, 100, batch);
  REQUIRE(batch.ticks.size() == 100);
  for (std::size_t i = 0; i < 100; ++i) {
    REQUIRE(batch.contact_ranges[i].count == (i < 50 ? 0 : kMaxTouches));
    for (std::size_t t = 0; t < batch.contact_ranges[i].count; ++t)
      REQUIRE(batch.contacts[batch.contact_ranges[i].first + t].obstacle == 100 * i + t);
  }
}

}  // namespace wrenchd::test_record_history
