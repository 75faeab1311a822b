// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>
#include <memory>
#include <mutex>

#include <catch2/catch.hpp>

#include "tests/support/no_allocation.hpp"
#include "tests/support/shipped_plan.hpp"

using namespace wrenchd;
using namespace wrenchd::test;

TEST_CASE("the guard sees what it is there to see", "[realtime]") {
  std::mutex mutex;
  const RealtimeGuard guard;
  static void* volatile escaped;  // an allocation that nobody can see may be left out by the compiler
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

TEST_CASE("ten thousand ticks with contact, saturation and a fault in them neither allocate nor lock",
          "[realtime]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  Plan plan = shipped_plan();
  plan.settings.rendering.method = method;
  plan.settings.limits.max_force_N = 1.0;
  plan.settings.recording.file = "not-written";  // records go into the ring, until it is full
  VirtualStation s(plan);
  s.inject(SimulatedFault::Kind::garble, 5.0, 0.002);
  s.inject(SimulatedFault::Kind::unplug, 9.99, 1.0);
  s.station.loop().arm();

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
