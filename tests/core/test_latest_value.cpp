// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

#include <catch2/catch.hpp>

#include "core/latest_value.hpp"

namespace wrenchd::test_latest_value {

namespace {

/// Large, so that a copy takes long; a torn copy contains parts of two numbers.
struct Large {
  std::array<std::uint64_t, 64> parts{};

  static Large of(std::uint64_t number) {
    Large value;
    for (std::size_t i = 0; i < value.parts.size(); ++i) value.parts[i] = number * 1'000 + i;
    return value;
  }
  std::uint64_t number() const { return parts[0] / 1'000; }
  bool whole() const { return parts == of(number()).parts; }
};

}  // namespace

TEST_CASE("without a write the reader keeps its value", "[latest_value]") {
  LatestValue<int> latest;
  int value = 7;
  CHECK_FALSE(latest.read(value));
  CHECK(value == 7);
}

TEST_CASE("a value is taken once", "[latest_value]") {
  LatestValue<int> latest;
  int value = 0;
  for (int i = 1; i <= 100; ++i) {
    latest.write(i);
    REQUIRE(latest.read(value));
    REQUIRE(value == i);
    REQUIRE_FALSE(latest.read(value));
    REQUIRE(value == i);
  }
}

TEST_CASE("the reader takes the newest of several values only", "[latest_value]") {
  LatestValue<int> latest;
  int value = 0;
  for (int burst = 1; burst <= 20; ++burst) {
    for (int i = 0; i < burst; ++i) latest.write(100 * burst + i);
    REQUIRE(latest.read(value));
    REQUIRE(value == 100 * burst + burst - 1);
    REQUIRE_FALSE(latest.read(value));
  }
}

TEST_CASE("between two threads no value is torn or repeated, and the newest arrives", "[latest_value]") {
  constexpr std::uint64_t kLast = 100'000;
  LatestValue<Large> latest;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kLast; ++i) latest.write(Large::of(i));
    done.store(true, std::memory_order_release);
  });

  // Checked after the join, because a failed check would leave a running thread.
  std::uint64_t seen = 0;
  std::uint64_t reads = 0;
  std::uint64_t torn = 0;
  std::uint64_t stale = 0;
  for (bool last_look = false;;) {
    Large value;
    if (latest.read(value)) {
      ++reads;
      if (!value.whole()) ++torn;
      if (value.number() <= seen) ++stale;
      seen = value.number();
    } else if (last_look) {
      break;
    }
    last_look = done.load(std::memory_order_acquire);
  }
  writer.join();
  CHECK(torn == 0);
  CHECK(stale == 0);
  CHECK(reads >= 1);
  CHECK(reads <= kLast);
  CHECK(seen == kLast);
}

TEST_CASE("in two directions at once each thread takes the newest value of the other", "[latest_value]") {
  constexpr std::uint64_t kRounds = 2'000;
  LatestValue<Large> there;
  LatestValue<Large> back;
  std::thread echo([&] {
    for (std::uint64_t i = 1; i <= kRounds;) {
      Large value;
      if (!there.read(value)) {
        std::this_thread::yield();
        continue;
      }
      back.write(value);
      ++i;
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t i = 1; i <= kRounds; ++i) {
    there.write(Large::of(i));
    Large value;
    while (!back.read(value)) std::this_thread::yield();
    if (!value.whole() || value.number() != i) ++wrong;
  }
  echo.join();
  CHECK(wrong == 0);
}

}  // namespace wrenchd::test_latest_value
