// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/links/latest_writer.hpp"
#include "devices/report_codec.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_latest_writer {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

/// A device that accepts reports only while its gate is open; otherwise the write blocks.
class Gate {
 public:
  LinkStatus write(std::span<const std::uint8_t> report) {
    std::unique_lock lock(mutex_);
    ++begun_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
    taken_.push_back(report[0]);
    changed_.notify_all();
    return status;
  }
  void set_open(bool open) {
    const std::lock_guard lock(mutex_);
    open_ = open;
    changed_.notify_all();
  }
  void await_begun(int n) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return begun_ >= n; });
  }
  void await_taken(std::size_t n) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return taken_.size() >= n; });
  }
  std::vector<std::uint8_t> taken() {
    const std::lock_guard lock(mutex_);
    return taken_;
  }

  LinkStatus status = LinkStatus::ok;

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::uint8_t> taken_;
  int begun_ = 0;
  bool open_ = true;
};

/// A writer at a gate. The gate outlives a detached writer.
struct Bench {
  std::shared_ptr<Gate> gate = std::make_shared<Gate>();
  LatestWriter writer;
  TimePoint now{1h};

  explicit Bench(const LinkSettings& settings = {.close_timeout = 1h})
      : writer([gate = gate](auto report) { return gate->write(report); }, settings) {}

  LinkStatus hand_over(std::uint8_t n) { return writer.submit(now, std::array{n}); }
};

using Bytes = std::vector<std::uint8_t>;

}  // namespace

TEST_CASE("a submitted report is written", "[usb]") {
  Bench bench;
  for (std::uint8_t n = 1; n <= 100; ++n) {
    CHECK(bench.hand_over(n) == LinkStatus::ok);
    bench.gate->await_taken(n);
  }
  CHECK(bench.writer.close());
  CHECK(bench.gate->taken().size() == 100);
  CHECK(bench.writer.slot().written() == 100);
}

TEST_CASE("while a write is stuck, only the newest report waits, and the delay is reported in time",
          "[usb]") {
  Bench bench;
  bench.gate->set_open(false);
  bench.hand_over(1);
  bench.gate->await_begun(1);
  for (std::uint8_t n = 2; n <= 9; ++n) {
    bench.now += 1ms;
    CHECK(bench.hand_over(n) == (n > 5 ? LinkStatus::not_ready : LinkStatus::ok));
  }
  bench.gate->set_open(true);
  CHECK(bench.writer.close());
  CHECK(bench.gate->taken() == Bytes{1, 9});
  CHECK(bench.writer.slot().replaced() == 7);
}

TEST_CASE("on every close the last submitted report is the last one written", "[usb]") {
  for (int round = 0; round < 200; ++round) {
    auto gate = std::make_shared<Gate>();
    {
      LatestWriter writer([gate](auto report) { return gate->write(report); }, {.close_timeout = 1h});
      for (std::uint8_t n = 1; n <= 20; ++n) writer.submit(TimePoint{1h}, std::array{n});
      writer.submit(TimePoint{1h}, std::array<std::uint8_t, 1>{0});  // the zeros of a release
    }
    REQUIRE_FALSE(gate->taken().empty());
    REQUIRE(gate->taken().back() == 0);
  }
}

TEST_CASE("close returns after its timeout, and the last report is written later", "[usb]") {
  Bench bench({.close_timeout = 1ms});
  bench.gate->set_open(false);
  bench.hand_over(1);
  bench.gate->await_begun(1);
  bench.hand_over(2);
  bench.hand_over(0);
  CHECK_FALSE(bench.writer.close());
  CHECK_FALSE(bench.writer.close());
  CHECK(bench.gate->taken().empty());
  bench.gate->set_open(true);
  bench.gate->await_taken(2);
  CHECK(bench.gate->taken() == Bytes{1, 0});
  CHECK_FALSE(bench.writer.close());  // the same result, without a second wait
}

TEST_CASE("the state of a write lives until the write ends", "[usb]") {
  auto gate = std::make_shared<Gate>();
  gate->set_open(false);
  {
    LatestWriter writer([gate](auto report) { return gate->write(report); }, {.close_timeout = 1ms});
    writer.submit(TimePoint{1h}, std::array<std::uint8_t, 1>{7});
    gate->await_begun(1);
  }
  CHECK(gate.use_count() > 1);
  gate->set_open(true);
  gate->await_taken(1);
  while (gate.use_count() > 1) std::this_thread::yield();
}

TEST_CASE("a disconnected device ends the writer", "[usb]") {
  Bench bench;
  bench.gate->status = LinkStatus::disconnected;
  bench.hand_over(1);
  while (!bench.writer.slot().disconnected()) std::this_thread::yield();
  CHECK(bench.hand_over(2) == LinkStatus::disconnected);
  CHECK_FALSE(bench.writer.close());
  CHECK(bench.gate->taken() == Bytes{1});
}

TEST_CASE("the writer sends zero commands for a hanging loop", "[usb]") {
  const DeviceProfile profile = load_profile(test::source_path("config/profiles/loopback.toml"));
  WrenchReport push;
  push.F.force_N = {0.0, 0.0, 1.0};
  push.enable = true;
  std::array<std::uint8_t, kMaxReportBytes> bytes{};
  const std::size_t length = encode(profile.wrench_report, push, bytes);
  Bench bench({.close_timeout = 1h, .host_watchdog = HostWatchdog(profile, 6ms)});
  for (const std::size_t stalls : {1U, 2U}) {
    const TimePoint start = std::chrono::steady_clock::now();
    bench.writer.submit(start, std::span(bytes).first(length));
    bench.gate->await_taken(stalls * (1 + HostWatchdog::kZeroReports));
    CHECK(std::chrono::steady_clock::now() - start >= 6ms);
    std::this_thread::sleep_for(20ms);
    CHECK(bench.gate->taken().size() == stalls * (1 + HostWatchdog::kZeroReports));
  }
}

TEST_CASE("a write that throws counts as failed", "[usb]") {
  LatestWriter writer([](auto) -> LinkStatus { throw std::runtime_error("no"); }, {.close_timeout = 1h});
  writer.submit(TimePoint{1h}, std::array<std::uint8_t, 1>{1});
  CHECK_FALSE(writer.close());
  CHECK(writer.slot().failed() == 1);
}

TEST_CASE("submitting a report does not allocate or lock", "[usb][realtime]") {
  Bench bench;
  std::uint64_t seen = 0;
  {
    const RealtimeGuard guard;
    for (int n = 0; n < 1000; ++n) bench.hand_over(static_cast<std::uint8_t>(n));
    seen = guard.allocations() + guard.locks();
  }
  CHECK(seen == 0);
}

}  // namespace wrenchd::test_latest_writer
