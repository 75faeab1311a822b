// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: core/state_machine.cpp core/transitions.cpp daemon/servo/watches.cpp
// daemon/servo/link_watch.cpp daemon/servo/pose_watch.cpp daemon/servo/motor_watch.cpp
// daemon/servo/write_watch.cpp daemon/servo/pace_watch.cpp daemon/servo/motor_stall_watch.cpp
// daemon/servo/client_watch.cpp daemon/servo/self_test.cpp
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "core/state_machine.hpp"
#include "daemon/servo/self_test.hpp"
#include "daemon/servo/watches.hpp"

// Sequences of samples, faults and commands through the fault detectors, the self-test and the state machine.
// For every sequence: authority is positive in driving states only, it rises in State::ramping only, and a
// latched state ends only by a command.

namespace {

using namespace wrenchd;

/// The bytes of the input; zeros behind its end.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}
  bool empty() const { return at_ == end_; }
  std::uint8_t next() { return at_ == end_ ? std::uint8_t{0} : *at_++; }
  double number() {
    std::uint8_t raw[8];
    for (std::uint8_t& byte : raw) byte = next();
    double x;
    std::memcpy(&x, raw, sizeof x);
    return x;
  }

 private:
  const std::uint8_t *at_, *end_;
};

void require(bool holds) {
  if (!holds) std::abort();
}

DeviceProfile profile() {
  DeviceProfile p;
  p.report_rate_Hz = 1000.0;
  p.watchdog_s = 0.008;
  p.workspace_radius_m = 0.25;
  p.deadman_button = 0;
  p.stop_button = 1;
  p.pose_report.sequence.present = p.pose_report.motors_on.present = p.pose_report.watchdog_tripped.present =
      true;
  return p;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const DeviceProfile p = profile();
  Watches watches(p, 10.0, 0.5);
  PaceWatch pace = make_pace_watch(ServoSettings{});
  SelfTest test(p, 0.02);
  StateMachine machine(0.05);
  TimePoint now{std::chrono::hours(1)};
  DeviceSample sample;
  bool testing = false, driven = false;
  double before = 0.0;
  while (!bytes.empty()) {
    const std::uint8_t what = bytes.next(), flags = bytes.next();
    now += (what & 1) != 0 ? std::chrono::microseconds(100 * bytes.next()) : std::chrono::microseconds(1000);
    if (what == 0xfe) now -= std::chrono::milliseconds(5);
    sample.fresh = (flags & 1) == 0;
    if (sample.fresh) {
      sample.arrived = now;
      sample.device_time_s += 1e-3;
      ++sample.sequence;
    }
    sample.motors_on = (flags & 2) != 0;
    sample.watchdog_tripped = (flags & 4) != 0;
    sample.homed = (flags & 8) == 0;
    sample.buttons = (flags >> 4 & 3) ^ 1U;
    sample.rejected = (flags & 64) != 0 ? bytes.next() : 0U;
    sample.repeated = sample.rejected / 2;
    sample.missing = (flags & 128) != 0 ? bytes.next() : 0U;
    sample.fault = (what & 2) != 0 ? static_cast<Fault>(bytes.next() % kFaultCount) : Fault::none;
    if ((what & 4) != 0) sample.X_BH.translation_m.x() = bytes.number();
    if ((what & 8) != 0) sample.V_BH.linear_m_per_s.y() = bytes.number();

    const State was = machine.state();
    bool opens = false;
    if (sample.fault != Fault::device_lost && transition(Trigger::device_connected, was).changes_state)
      machine.on(Trigger::device_connected);
    TickTime t;
    t.now = now;
    t.faults = pace.check(now, Duration{0});
    t.recently_late = pace.recently_late(now);
    const FaultSet found = t.faults | watches.check(sample, machine.state(), driven, t);
    for (FaultSet left = found; left != 0; left &= left - 1) machine.on(first_fault(left));
    if (const Fault overdue = machine.overdue(); overdue != Fault::none) machine.on(overdue);
    if (machine.state() == State::self_test) {
      if (!testing) test.start(now);
      testing = true;
      machine.on(test.check(sample, found, now));
      if (test.passed()) machine.on(Trigger::self_test_passed);
    }
    testing = machine.state() == State::self_test;
    if ((what & 16) != 0) {
      const auto trigger = static_cast<Trigger>(bytes.next() % kTriggerCount);
      opens = trigger == Trigger::acknowledge || trigger == Trigger::quit || trigger == Trigger::process_end;
      machine.on(trigger);
    }
    if (is_latched(was) && !opens) require(is_latched(machine.state()));
    const State in = machine.state();
    const double authority = machine.advance((what & 32) != 0, pace.dt_s());
    require(authority >= 0.0 && authority <= 1.0);
    require(authority == 0.0 || is_driving(machine.state()));
    require(authority <= before || in == State::ramping);
    before = authority;
    driven = is_driving(machine.state());
  }
  return 0;
}
