// SPDX-License-Identifier: GPL-3.0-or-later
#include <future>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "daemon/control/worker_queue.hpp"
#include "daemon/thread_guard.hpp"

namespace wrenchd::test_thread_guard {

namespace {

TEST_CASE("a step that throws ends alone, whatever it throws", "[thread_guard]") {
  ThreadGuard guard("a thread of the test");
  CHECK_FALSE(guard.run([] { throw std::runtime_error("the disk is gone"); }));
  CHECK_FALSE(guard.run([] { throw 7; }));
  bool ran = false;
  CHECK(guard.run([&] { ran = true; }));
  CHECK(ran);
}

TEST_CASE("a task that throws does not end the worker", "[thread_guard]") {
  std::promise<void> done;
  WorkerQueue worker;
  constexpr uid_t kUser = 1;
  worker.post(kUser, Role::observer, [] { throw std::runtime_error("no memory for a scene"); });
  REQUIRE(worker.post(kUser, Role::observer, [&] { done.set_value(); }) == WorkerQueue::Posted::yes);
  done.get_future().wait();
}

}  // namespace
}  // namespace wrenchd::test_thread_guard
