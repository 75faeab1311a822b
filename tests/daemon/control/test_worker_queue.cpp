// SPDX-License-Identifier: GPL-3.0-or-later
#include <future>
#include <mutex>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/control/worker_queue.hpp"

namespace wrenchd::test_worker_queue {

namespace {

using Posted = WorkerQueue::Posted;
constexpr uid_t kGreedy = 1, kOther = 2;

/// A queue whose thread is occupied until release().
struct Occupied {
  std::promise<void> go, runs;
  std::mutex mutex;
  std::vector<uid_t> order;
  WorkerQueue queue;

  Occupied() {
    queue.post(0, Role::administrator, [this] {
      runs.set_value();
      go.get_future().wait();
    });
    runs.get_future().wait();
  }
  Posted post(uid_t user, Role role) {
    return queue.post(user, role, [this, user] {
      const std::scoped_lock lock(mutex);
      order.push_back(user);
    });
  }
};

TEST_CASE("a user who fills the queue keeps no other user out of it, and does not go first",
          "[worker_queue]") {
  std::vector<uid_t> order;
  {
    Occupied worker;
    std::size_t accepted = 0;
    for (std::size_t i = 0; i < WorkerQueue::kMaxQueued; ++i)
      accepted += worker.post(kGreedy, Role::observer) == Posted::yes;
    CHECK(accepted == WorkerQueue::kMaxQueuedPerUser);
    CHECK(worker.post(kGreedy, Role::observer) == Posted::user_has_too_many);
    CHECK(worker.post(kOther, Role::observer) == Posted::yes);
    std::promise<void> last;
    CHECK(worker.queue.post(3, Role::observer, [&] { last.set_value(); }) == Posted::yes);
    worker.go.set_value();
    last.get_future().wait();
    const std::scoped_lock lock(worker.mutex);
    order = worker.order;
  }
  REQUIRE(order.size() >= 2);
  CHECK(order[0] == kGreedy);
  CHECK(order[1] == kOther);
}

TEST_CASE("many observers leave places for higher roles", "[worker_queue]") {
  Occupied worker;
  uid_t user = 100;
  const auto fill = [&](Role role) {
    while (worker.post(user++, role) == Posted::yes) {
    }
  };
  fill(Role::observer);
  CHECK(worker.post(user++, Role::observer) == Posted::full);
  CHECK(worker.post(user++, Role::operator_) == Posted::yes);
  fill(Role::operator_);
  CHECK(worker.post(user++, Role::operator_) == Posted::full);
  CHECK(worker.post(user++, Role::administrator) == Posted::yes);
  worker.go.set_value();
}

}  // namespace
}  // namespace wrenchd::test_worker_queue
