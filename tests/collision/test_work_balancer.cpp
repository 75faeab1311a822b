// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/work_balancer.hpp"

namespace wrenchd::test_work_balancer {

namespace {

WorkBalancer after(int ticks, std::uint32_t sweep_visits, double list) {
  WorkBalancer work;
  for (int i = 0; i < ticks; ++i) work.update(sweep_visits, list, false);
  return work;
}

TEST_CASE("the work limit is a small multiple of the usual work", "[work_balancer]") {
  const WorkBalancer work = after(200, 3000, 7000.0);
  CHECK(work.typical_sweep_visits() == Approx(3000.0));
  CHECK(work.max_visits(1.0) > 15'000);
  CHECK(work.max_visits(1.0) <= 40'000);
}

TEST_CASE("work that fits the period is never deferred", "[work_balancer]") {
  CHECK(WorkBalancer().max_visits(1.0) >= 5000);
  CHECK(after(200, 5, 2.0).max_visits(1.0) >= 5000);
  CHECK(after(200, 5, 2.0).max_visits(1.0) <= 10'000);
}

TEST_CASE("one expensive tick changes the estimate little", "[work_balancer]") {
  WorkBalancer work = after(200, 3000, 7000.0);
  const std::uint32_t before = work.max_visits(1.0);
  work.update(30'000, 7000.0, false);
  CHECK(work.max_visits(1.0) < before * 1.2);
}

TEST_CASE("a lasting increase of the cost soon becomes the usual cost", "[work_balancer]") {
  WorkBalancer work = after(200, 100, 100.0);
  const double before = work.target_visits();
  for (int i = 0; i < 1000; ++i) work.update(500, 1000.0, false);
  CHECK(work.target_visits() > 5.0 * before);
  CHECK(work.typical_sweep_visits() > 300.0);
}

TEST_CASE("a tool at rest may move immediately: the cost of lists counts, not that of rest",
          "[work_balancer]") {
  CHECK(after(10000, 1, 17'000.0).max_visits(1.0) > 25'000);
}

TEST_CASE("the limit grows with the urgency, so a fast hand is never limited", "[work_balancer]") {
  const WorkBalancer work = after(200, 3000, 7000.0);
  CHECK(work.max_visits(10.0) == 10 * work.max_visits(1.0));
  CHECK(work.max_visits(1e30) > 1'000'000);
}

TEST_CASE("consecutive deferrals raise the limit, and later ticks lower it again", "[work_balancer]") {
  WorkBalancer work = after(200, 3000, 7000.0);
  const std::uint32_t before = work.max_visits(1.0);
  for (int i = 0; i < 3; ++i) work.update(3000, 7000.0, true);
  CHECK(work.max_visits(1.0) <= 1.01 * before);  // a slow hand tolerates this delay
  for (int i = 0; i < 4; ++i) work.update(3000, 7000.0, true);
  const std::uint32_t after_some = work.max_visits(1.0);
  CHECK(after_some > 1.2 * before);
  for (int i = 0; i < 100; ++i) work.update(3000, 7000.0, true);
  CHECK(work.max_visits(1.0) > 1.5 * after_some);  // the proxy does not fall behind permanently
  CHECK(work.max_visits(1.0) < 6.0 * before);
  for (int i = 0; i < 50; ++i) work.update(3000, 7000.0, false);
  CHECK(work.max_visits(1.0) <= 1.01 * before);
}

TEST_CASE("the target is such that few ticks need twice as much", "[work_balancer]") {
  WorkBalancer work;
  for (int i = 0; i < 1000; ++i) work.update(i % 10 == 0 ? 260 : 80, 50.0, false);
  CHECK(2.0 * work.target_visits() > 260.0 + 50.0);
  CHECK(2.0 * work.target_visits() <= work.max_visits(1.0) + 1.0);
  const WorkBalancer listing = after(1000, 100, 3000.0);
  CHECK(listing.target_visits() < 1.1 * (100.0 + 3000.0));
  CHECK(WorkBalancer().target_visits() == 0.0);  // no estimate exists
}

TEST_CASE("a reset discards the estimates", "[work_balancer]") {
  WorkBalancer work = after(200, 3000, 7000.0);
  work.reset();
  CHECK(work.max_visits(1.0) == WorkBalancer().max_visits(1.0));
  // The first list does not exist before the first deferral, which yields no estimate.
  work.update(0, 0.0, true);
  CHECK(work.max_visits(1.0) >= WorkBalancer().max_visits(1.0));
}

}  // namespace
}  // namespace wrenchd::test_work_balancer
