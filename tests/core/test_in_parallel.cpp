// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <sys/resource.h>

#include "core/in_parallel.hpp"

namespace wrenchd::test_in_parallel {

TEST_CASE("each number is worked on once, whatever the number of threads", "[in_parallel]") {
  for (const std::size_t count : {0, 1, 2, 7, 1000})
    for (const std::size_t threads : {1, 2, 3, 8}) {
      std::vector<int> calls(count, 0);
      in_parallel(count, threads, [&](std::size_t i) { ++calls[i]; });
      CHECK(std::all_of(calls.begin(), calls.end(), [](int n) { return n == 1; }));
    }
}

TEST_CASE("two threads work at the same time, one of them the caller's", "[in_parallel]") {
  std::atomic<int> arrived{0};
  std::vector<std::thread::id> ids(2);
  in_parallel(2, 2, [&](std::size_t i) {
    ids[i] = std::this_thread::get_id();
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  CHECK(ids[0] == std::this_thread::get_id());
  CHECK(ids[1] != ids[0]);
}

TEST_CASE("an exception of a thread reaches the caller after all have ended", "[in_parallel]") {
  std::atomic<int> ended{0};
  const auto work = [&](std::size_t i) {
    if (i == 3) throw std::runtime_error("four");
    ++ended;
  };
  CHECK_THROWS_WITH(in_parallel(4, 4, work), "four");
  CHECK(ended == 3);
  CHECK_THROWS_WITH(in_parallel(1, 4, [](std::size_t) { throw std::runtime_error("one"); }), "one");
}

TEST_CASE("the caller does all of the work if the system gives no thread", "[in_parallel]") {
  rlimit before{};
  getrlimit(RLIMIT_AS, &before);
  const rlimit none{1, before.rlim_max};  // no room for the stack of a thread
  std::vector<int> calls(3, 0);
  setrlimit(RLIMIT_AS, &none);
  in_parallel(3, 3, [&](std::size_t i) { ++calls[i]; });
  setrlimit(RLIMIT_AS, &before);
  CHECK(calls == std::vector<int>(3, 1));
}

TEST_CASE("a thread is started only for enough work, and for a processor", "[in_parallel]") {
  CHECK(threads_for(0, 100) == 1);
  CHECK(threads_for(199, 100) == 1);
  CHECK(threads_for(1'000'000, 100) == std::max(std::thread::hardware_concurrency(), 1U));
}

}  // namespace wrenchd::test_in_parallel
