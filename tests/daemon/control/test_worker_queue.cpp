// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/control/worker_queue.hpp"

namespace wrenchd {
namespace {

using namespace std::chrono_literals;
using Refusal = WorkerQueue::Refusal;

/// Keeps the worker busy until the test ends it.
struct Busy {
  std::atomic<bool> running{false}, go{false};
  void start(WorkerQueue& queue) {
    REQUIRE(queue.post(0, true, [this] {
      running = true;
      while (!go) std::this_thread::sleep_for(1ms);
    }) == Refusal::none);
    while (!running) std::this_thread::sleep_for(1ms);
  }
};

TEST_CASE("users take turns in the queue of slow work", "[worker_queue]") {
  Busy busy;
  std::vector<int> order;
  std::atomic<bool> done{false};
  WorkerQueue queue;
  busy.start(queue);
  for (int i = 0; i < 5; ++i)
    REQUIRE(queue.post(1001, false, [&order, i] { order.push_back(100 + i); }) == Refusal::none);
  REQUIRE(queue.post(1002, false, [&order] { order.push_back(200); }) == Refusal::none);
  REQUIRE(queue.post(1002, false, [&order] { order.push_back(201); }) == Refusal::none);
  REQUIRE(queue.post(1003, false, [&order] { order.push_back(300); }) == Refusal::none);
  REQUIRE(queue.post(1001, false, [&done] { done = true; }) == Refusal::none);
  busy.go = true;
  while (!done) std::this_thread::sleep_for(1ms);
  CHECK(order == std::vector<int>{100, 200, 300, 101, 201, 102, 103, 104});
}

TEST_CASE("one user cannot fill the queue, and observers cannot fill the room of higher roles",
          "[worker_queue]") {
  Busy busy;
  WorkerQueue queue;
  busy.start(queue);
  const auto post_all = [&queue](uid_t user, bool reserved) {
    std::size_t posted = 0;
    while (queue.post(user, reserved, [] {}) == Refusal::none) ++posted;
    return posted;
  };
  CHECK(post_all(1001, false) == WorkerQueue::kMaxQueuedPerUser);
  CHECK(queue.post(1001, true, [] {}) == Refusal::user_full);
  std::size_t of_observers = WorkerQueue::kMaxQueuedPerUser;
  for (uid_t user = 1002; user < 1010; ++user) of_observers += post_all(user, false);
  CHECK(of_observers == WorkerQueue::kMaxQueued - WorkerQueue::kReserved);
  CHECK(queue.post(1020, false, [] {}) == Refusal::full);
  CHECK(queue.post(1020, true, [] {}) == Refusal::none);
  busy.go = true;
}

}  // namespace
}  // namespace wrenchd
