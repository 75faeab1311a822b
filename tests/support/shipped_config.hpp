// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/runtime.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/simulation/simulated_device.hpp"

namespace wrenchd::test {

/// The configuration as it is shipped: simulated device, cube on table. The self-test is left out, so that a
/// test begins with what it is about.
inline Plan shipped_plan() {
  Plan plan = read_plan({WRENCHD_SOURCE_DIR "/config/wrenchd.toml", {}, {}, false},
                        SearchPath({WRENCHD_SOURCE_DIR "/config"}));
  plan.settings.servo.self_test_s = 0.0;
  return plan;
}

/// A station with its simulated device within reach, opened.
template <class TheClock>
struct SimulatedStation {
  TheClock clock;
  SimulatedDevice simulated;
  LoopbackLink link;
  Station station;

  explicit SimulatedStation(Plan plan, PlaceIn place_in = PlaceIn::thread)
      : simulated(plan.profile, plan.settings.simulation),
        link(simulated, clock, plan.settings.simulation),
        station(std::move(plan), link, clock, place_in) {
    station.open();
  }
};

/// The same in virtual time, ticked by hand.
struct VirtualStation : SimulatedStation<VirtualClock> {
  TickRecord last;

  explicit VirtualStation(Plan plan = shipped_plan(), PlaceIn place_in = PlaceIn::step)
      : SimulatedStation(std::move(plan), place_in) {}

  Fault tick() { return tick_after(from_seconds(1.0 / station.plan().settings.servo.rate_Hz)); }
  Fault tick_after(Duration pause) {
    clock.sleep_until(clock.now() + pause);
    const Fault fault = station.loop().tick(clock.now(), clock.now());
    station.loop().latest().read(last);
    return fault;
  }
  /// Ticks until a fault, or for so long. Returns the fault.
  Fault run(double duration_s) {
    const TimePoint end = clock.now() + from_seconds(duration_s);
    Fault fault = Fault::none;
    while (fault == Fault::none && clock.now() < end) fault = tick();
    return fault;
  }
  double force_N() const { return Vector3d(last.F_out[0], last.F_out[1], last.F_out[2]).norm(); }
  double torque_Nm() const { return Vector3d(last.F_out[3], last.F_out[4], last.F_out[5]).norm(); }
  State state() const { return static_cast<State>(last.state); }
  Fault cause() const { return static_cast<Fault>(last.cause); }
  void inject(SimulatedFault::Kind kind, double start_s, double duration_s) {
    simulated.inject({kind, from_seconds(start_s), from_seconds(duration_s)});
  }
};

}  // namespace wrenchd::test
