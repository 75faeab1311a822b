// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>

#include <catch2/catch.hpp>
#include <sys/resource.h>

#include "collision/penetration.hpp"
#include "tests/support/buried_tool.hpp"
#include "tests/support/fault_rig.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_body.hpp"

namespace wrenchd::test_no_allocation {

using namespace wrenchd::test;

TEST_CASE("the guard counts allocations and locks", "[realtime]") {
  std::mutex mutex;
  const RealtimeGuard guard;
  static void* volatile escaped;  // the compiler may remove an allocation that does not escape
  escaped = std::malloc(8);
  std::free(escaped);
  escaped = std::make_unique<int>(1).release();
  delete static_cast<int*>(escaped);
  { const std::lock_guard lock(mutex); }
  CHECK(guard.allocations() == 4);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  CHECK(guard.locks() == 1);
#endif
}

TEST_CASE("ten thousand ticks with contact, saturation and a fault neither allocate nor lock", "[realtime]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  RunConfig plan = shipped_config();
  plan.settings.rendering.method = method;
  plan.settings.limits.max_force_N = 1.0;
  VirtualRuntime s(plan);
  s.runtime.enable_shared_state();
  s.inject(SimulatedFault::Kind::corrupt, 5.0, 0.002);
  s.inject(SimulatedFault::Kind::unplug, 9.99, 1.0);
  s.runtime.loop().requests().arm();

  int in_contact = 0;
  int saturated = 0;
  int ticks = 0;
  Fault fault = Fault::none;
  std::uint64_t allocations = 0;
  std::uint64_t locks = 0;
  {
    const RealtimeGuard guard;
    for (; ticks < 10000 && fault == Fault::none; ++ticks) {
      fault = s.tick();
      in_contact += s.last.contacts > 0 ? 1 : 0;
      saturated += (s.last.limit_causes & kForceMagnitude) != 0 ? 1 : 0;
    }
    for (; ticks < 10000; ++ticks) s.tick();  // and after the fault
    allocations = guard.allocations();
    locks = guard.locks();
  }
  CHECK(fault == Fault::device_lost);
  CHECK(in_contact > 3000);
  CHECK(saturated > 500);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("no fault makes the loop allocate, lock or touch a page for the first time", "[realtime][faults]") {
  std::uint64_t allocations = 0, locks = 0;
  [[maybe_unused]] long page_faults = 0;  // a sanitizer touches pages of its own
  for (const Injection& injection : injections())
    for (const State state :
         {State::self_test, State::waiting, State::active, State::degraded, State::releasing}) {
      if (!injection.applies(state, Phase::contact)) continue;
      FaultRig rig(Phase::contact);
      REQUIRE(rig.bring_to(state));
      injection.begin(rig);
      const RealtimeGuard guard;
      rusage before{}, after{};
      getrusage(RUSAGE_THREAD, &before);
      for (int i = 0; i < 120; ++i) rig.tick();
      getrusage(RUSAGE_THREAD, &after);
      const std::uint64_t here = guard.allocations();  // what follows allocates
      locks += guard.locks();
      allocations += here;
      INFO(injection.name << ", " << name(state) << rig.violation());
      CHECK(here == 0);
      CHECK(rig.violation().empty());
      page_faults += after.ru_minflt - before.ru_minflt + after.ru_majflt - before.ru_majflt;
    }
  CHECK(allocations == 0);
  CHECK(locks == 0);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // Observed: up to 13, the first rings and queues of a process that has not locked its memory. A loop that
  // touches a new page in each case has more than 200.
  CHECK(page_faults <= 50);
#endif
}

TEST_CASE("proxy initialization, its repetition and arming neither allocate nor lock in the servo thread",
          "[realtime][proxy_initialization]") {
  const bool boulder_moves = GENERATE(false, true);
  BuriedTool buried({{0.0, {0, 0, 0.03}}, {0.5, {0, 0, 0.08}}});
  if (boulder_moves) buried.config.scene.meshes[0].motion = {{0.0, 0.0, 0.005}, {0.0, 0.2, 0.0}, 0.3};
  VirtualRuntime s(buried.config, ProxySearchMode::background);
  int searching = 0;
  int found = 0;
  std::uint64_t allocations = 0;
  std::uint64_t locks = 0;
  for (int ticks = 0; found < 3 && ticks < 100000; ++ticks) {
    wait_for_proxy_search(s);
    const RealtimeGuard guard;
    if (proxy_initialization(s) == ProxyInitialization::complete && found == 1)
      s.runtime.loop().requests().reinitialize_proxy();
    if (proxy_initialization(s) == ProxyInitialization::complete && found == 2)
      s.runtime.loop().requests().arm();
    s.tick();
    searching += proxy_initialization(s) == ProxyInitialization::searching ? 1 : 0;
    found += proxy_initialization(s) == ProxyInitialization::found ? 1 : 0;
    allocations += guard.allocations();
    locks += guard.locks();
  }
  CHECK(found == 3);
  CHECK(searching >= 3);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("following a hand around a convex body neither allocates nor locks", "[realtime][convex]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  RandomValues random(31);
  const Scene scene(random_body(random, 40), {half_space(Vector3d::UnitZ(), -1.2)},
                    {convex_obstacle("body", random_body(random, 50).hull)});
  PenetrationDepth depth(scene, {method});
  const int steps = method == Method::exact ? 2000 : 100;
  int in_contact = 0;
  std::uint64_t allocations = 0;
  std::uint64_t locks = 0;
  {
    const RealtimeGuard guard;
    Pose X_last{Quaterniond::Identity(), {3.0, 0.0, 0.0}};
    for (int k = 0; k < steps; ++k) {
      const double t = 10.0 * k / steps;
      const double away = std::max(0.9, 3.0 - t);
      const Pose X_WP{rotation_from({t, 0.3 * std::sin(t), 0.0}),
                      {away * std::cos(t), away * std::sin(t), 0.3 * std::sin(2.0 * t)}};
      const Penetration p = depth.follow(X_WP, X_last);
      in_contact += p.contacts > 0 ? 1 : 0;
      X_last = p.projection.X_WQ;
    }
    depth.query({Quaterniond::Identity(), {0.8, 0.0, 0.0}});
    allocations = guard.allocations();
    locks = guard.locks();
  }
  CHECK(in_contact > steps / 4);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace wrenchd::test_no_allocation
