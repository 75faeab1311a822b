// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/runtime.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test {

/// Returns the shipped configuration: simulated device, cube on table. The self-test is disabled, so that a
/// test starts directly.
inline RunConfig shipped_config() {
  RunConfig plan = load_run_config({source_path("config/wrenchd.toml"), {}, {}, false},
                                   SearchPath({source_path("config")}));
  plan.settings.servo.self_test_s = 0.0;
  return plan;
}

/// A runtime with an open simulated device that the test can access.
template <class TheClock>
struct SimulatedRuntime {
  TheClock clock;
  SimulatedDevice simulated;
  LoopbackLink link;
  Runtime runtime;

  explicit SimulatedRuntime(RunConfig plan, ProxySearchMode place_in = ProxySearchMode::background)
      : simulated(plan.profile, plan.settings.simulation),
        link(simulated, clock, plan.settings.simulation),
        runtime(std::move(plan), link, clock, place_in) {
    runtime.open();
  }
};

/// A runtime with a simulated device in virtual time. The test runs each tick.
struct VirtualRuntime : SimulatedRuntime<VirtualClock> {
  TickRecord last;

  explicit VirtualRuntime(RunConfig plan = shipped_config(),
                          ProxySearchMode place_in = ProxySearchMode::in_tick)
      : SimulatedRuntime(std::move(plan), place_in) {}

  Fault tick() { return tick_after(from_seconds(1.0 / runtime.config().settings.servo.rate_Hz)); }
  Fault tick_after(Duration pause) {
    clock.sleep_until(clock.now() + pause);
    const Fault fault = runtime.loop().tick(clock.now(), clock.now());
    runtime.loop().telemetry().latest_record().read(last);
    return fault;
  }
  /// Runs ticks until a fault occurs or the duration ends. Returns the fault.
  Fault run(double duration_s) {
    const TimePoint end = clock.now() + from_seconds(duration_s);
    Fault fault = Fault::none;
    while (fault == Fault::none && clock.now() < end) fault = tick();
    return fault;
  }
  double force_N() const { return Vector3d(last.F_out[0], last.F_out[1], last.F_out[2]).norm(); }
  double torque_Nm() const { return Vector3d(last.F_out[3], last.F_out[4], last.F_out[5]).norm(); }
  State state() const { return static_cast<State>(last.state); }
  Fault cause() const { return last.state_cause; }
  void inject(SimulatedFault::Kind kind, double start_s, double duration_s) {
    simulated.inject({kind, from_seconds(start_s), from_seconds(duration_s)});
  }
};

}  // namespace wrenchd::test
