// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <future>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/output_queue.hpp"

namespace wrenchd::test_output_queue {

namespace {

/// An output that waits until the test lets it go, as a write to a pipe whose reader has stopped does.
struct StalledOutput {
  std::promise<void> begun, go_on;
  std::shared_future<void> may_go_on = go_on.get_future().share();

  OutputQueue::Output output() {
    return [this, may = may_go_on] {
      begun.set_value();
      may.wait();
    };
  }
};

TEST_CASE("outputs run in order on another thread, and close() waits for them", "[output_queue]") {
  std::vector<int> order;
  std::thread::id thread;
  OutputQueue queue;
  for (int i = 0; i < 100; ++i)
    queue.post(1, [&, i] {
      order.push_back(i);
      thread = std::this_thread::get_id();
    });
  REQUIRE(queue.close());
  REQUIRE(order.size() == 100);
  CHECK(std::is_sorted(order.begin(), order.end()));
  CHECK(thread != std::this_thread::get_id());
  CHECK(queue.dropped() == 0);
  queue.post(1, [&] { order.clear(); });  // after close() nothing runs
  CHECK(queue.close());
  CHECK(order.size() == 100);
}

TEST_CASE("a stalled output blocks neither post() nor close(); later outputs are dropped and counted",
          "[output_queue]") {
  StalledOutput stalled;
  std::atomic<int> ran{0};
  {
    OutputQueue queue;
    queue.post(1, stalled.output());
    stalled.begun.get_future().wait();
    for (std::size_t i = 0; i < OutputQueue::kMaxOutputs + 100; ++i) queue.post(1, [&] { ++ran; });
    CHECK(queue.dropped() == 100);
    CHECK_FALSE(queue.close());
  }
  CHECK(ran == 0);
  stalled.go_on.set_value();  // the thread that was left behind ends
}

TEST_CASE("the queue is bounded in bytes too", "[output_queue]") {
  StalledOutput stalled;
  OutputQueue queue;
  queue.post(1, stalled.output());
  stalled.begun.get_future().wait();
  queue.post(OutputQueue::kMaxBytes, [] {});
  CHECK(queue.dropped() == 0);
  queue.post(1, [] {});
  CHECK(queue.dropped() == 1);
  stalled.go_on.set_value();
  CHECK(queue.close());
}

TEST_CASE("dropped outputs are reported in their place", "[output_queue]") {
  StalledOutput stalled;
  std::vector<std::string> log;
  std::promise<void> reported;
  OutputQueue queue([&](std::uint64_t count) {
    log.push_back(std::to_string(count) + " dropped");
    reported.set_value();
  });
  queue.post(1, stalled.output());
  stalled.begun.get_future().wait();
  queue.post(OutputQueue::kMaxBytes, [&] { log.emplace_back("before"); });
  for (int i = 0; i < 3; ++i) queue.post(1, [&] { log.emplace_back("dropped"); });
  stalled.go_on.set_value();
  reported.get_future().wait();
  while (!queue.close()) {
  }
  CHECK(log == std::vector<std::string>{"before", "3 dropped"});
}

TEST_CASE("an output that throws does not end the thread", "[output_queue]") {
  bool ran = false;
  OutputQueue queue;
  queue.post(1, [] { throw std::runtime_error("a write failed"); });
  queue.post(1, [&] { ran = true; });
  CHECK(queue.close());
  CHECK(ran);
}

}  // namespace
}  // namespace wrenchd::test_output_queue
