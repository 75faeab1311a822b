// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/fault_rig.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "daemon/servo/two_loops.hpp"

namespace wrenchd::test {
namespace {

using Kind = SimulatedFault::Kind;

constexpr double kArmAt_s = 0.08;
constexpr double kPressed_s = 0.5;  ///< time at which the hand has reached the phase's target
constexpr int kDeadman = 0;
constexpr int kStopButton = 1;

Invariants::Limits limits_of(const RunConfig& plan) {
  return {plan.profile.max_force_N,
          plan.profile.max_torque_Nm,
          plan.settings.limits.force_slew_N_per_s,
          plan.settings.limits.torque_slew_Nm_per_s,
          1.0 / plan.settings.servo.rate_Hz,
          0.004};
}
bool armed(State s, Phase) {
  return is_driving(s) || s == State::waiting;
}
bool under_way(State s, Phase) {
  return s == State::active || s == State::ramping || s == State::degraded;
}

std::function<void(FaultRig&)> wire(Kind kind, double for_s, double value = 0.0) {
  return [=](FaultRig& rig) { rig.inject(kind, for_s, value); };
}
std::function<void(FaultRig&)> spoil(std::function<void(DeviceSample&)> how) {
  return [how](FaultRig& rig) { rig.faulty_device.corrupt = how; };
}

}  // namespace

const char* name(Phase phase) {
  return phase == Phase::free ? "free" : phase == Phase::contact ? "contact" : "saturated";
}

RunConfig FaultRig::plan(Phase phase, const std::function<void(RunConfig&)>& adjust) {
  RunConfig plan = shipped_config();
  plan.settings.servo.realtime = Realtime::required;
  plan.settings.servo.self_test_s = 0.03;
  plan.settings.limits.soft_start_s = 0.05;
  plan.settings.limits.max_force_N = phase == Phase::saturated ? 1.0 : 5.0;
  plan.profile.deadman_button = kDeadman;
  plan.profile.stop_button = kStopButton;
  const double end_z_m = phase == Phase::free ? 0.06 : phase == Phase::contact ? 0.018 : -0.005;
  plan.settings.simulation.hand_path = {
      {0.0, {0, 0, 0.06}, {0, 0, 0}}, {0.3, {0, 0, 0.06}, {0, 0, 0}}, {0.42, {0, 0, end_z_m}, {0, 0, 0}}};
  plan.settings.simulation.hand_repeats = false;
  if (adjust) adjust(plan);
  return plan;
}

FaultRig::FaultRig(Phase phase, const std::function<void(RunConfig&)>& adjust)
    : FaultRig(plan(phase, adjust), HandScene{}, nullptr) {}

FaultRig::FaultRig(RunConfig plan, const HandScene& hand, RigClock& shared_clock)
    : FaultRig(std::move(plan), hand, &shared_clock) {
  loop.start_scene_at(TimePoint{});
}

FaultRig::FaultRig(RunConfig plan, const HandScene& hand, RigClock* shared_clock)
    : clock(shared_clock != nullptr ? *shared_clock : own_clock),
      config(std::move(plan)),
      scene(hand.scene ? hand.scene : std::make_shared<const Scene>(config.scene)),
      simulated(config.profile, config.settings.simulation),
      link(simulated, clock, config.settings.simulation),
      device(config.profile, link),
      faulty_device(device),
      proxy_initializer(std::make_shared<OverriddenProxyInitializer>(*scene)),
      loop(config.settings, config.profile, faulty_device,
           std::make_unique<Rendering>(0, config.settings, config.profile, scene, proxy_initializer,
                                       hand.tool),
           clock),
      invariants_(limits_of(config)) {
  simulated.inject({Kind::press_button, Duration{0}, std::chrono::hours(1), kDeadman});
  faulty_device.open();
}

const TickRecord& FaultRig::tick(Duration after) {
  const Duration half = other != nullptr ? after / 2 : Duration{0};
  clock.step(after - half);
  tick_alone(other);
  if (other != nullptr) {
    clock.step(half);
    other->tick_alone(this);
  }
  return last_;
}

void FaultRig::tick_alone(FaultRig* partner) {
  if (arms_itself && state() == State::disarmed && clock.now() >= TimePoint{} + from_seconds(kArmAt_s)) {
    loop.requests().arm();
    arms_itself = false;
  }
  const std::size_t held = loop.held_body();
  loop.tick(clock.now(), clock.now());
  if (partner != nullptr) release_other_hand(loop, held, partner->loop);
  loop.telemetry().latest_record().read(last_);
  if (const auto wrong = invariants_.check(last_); wrong && violation_.empty()) violation_ = *wrong;
}

bool FaultRig::bring_to(State state) {
  const auto tick_until = [this](auto there, int most) {
    for (int i = 0; i < most && !there(); ++i) tick();
    return there();
  };
  const auto in = [this](State s) { return [this, s] { return this->state() == s; }; };
  const auto at = [this](double t_s) {
    return [this, t_s] { return clock.now() >= TimePoint{} + from_seconds(t_s); };
  };
  if (!tick_until(in(State::disarmed), 300)) return false;
  if (state != State::disarmed) {
    if (!tick_until(at(kArmAt_s), 300)) return false;
    loop.requests().arm();
    if (!tick_until(in(State::active), 300)) return false;
  }
  tick_until(at(kPressed_s), 1000);
  switch (state) {
    case State::disarmed:
    case State::active:
      break;
    case State::waiting:
      loop.requests().reinitialize_proxy();
      break;
    case State::degraded:
    case State::ramping:
      inject(Kind::silence, 0.005);
      break;
    case State::releasing:
      loop.requests().disarm();
      break;
    case State::fault:
      faulty_device.corrupt = [](DeviceSample& s) {
        s.X_BH.translation_m.x() = std::numeric_limits<double>::quiet_NaN();
      };
      tick();
      faulty_device.corrupt = {};
      break;
    case State::stopped:
      loop.requests().stop();
      break;
    case State::self_test:
      loop.requests().stop();
      tick();
      loop.requests().acknowledge();
      break;
    default:
      return false;
  }
  return tick_until(in(state), 200);
}

double FaultRig::force_N() const noexcept {
  return std::hypot(last_.F_out[0], last_.F_out[1], last_.F_out[2]);
}

void FaultRig::inject(Kind kind, double for_s, double value) {
  simulated.inject(
      {kind, clock.now() - TimePoint{} - std::chrono::milliseconds(1), from_seconds(for_s), value});
}

const std::vector<State>& rig_states() {
  static const std::vector<State> states = {State::self_test, State::disarmed, State::waiting,
                                            State::ramping,   State::active,   State::degraded,
                                            State::releasing, State::fault,    State::stopped};
  return states;
}

const std::vector<Injection>& injections() {
  static const std::vector<Injection> all = [] {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInf = std::numeric_limits<double>::infinity();
    std::vector<Injection> list;
    const auto add = [&list](Injection injection) { list.push_back(std::move(injection)); };
    const auto not_testing = [](State s, Phase) { return s != State::self_test; };

    add({"unplugged", Fault::device_lost, 1, wire(Kind::unplug, 0.5)});
    add({"a write finds no device",
         Fault::device_lost,
         1,
         [](FaultRig& r) { r.faulty_device.write_result = Fault::device_lost; },
         {},
         not_testing});
    add({"garbled", Fault::report_malformed, 3, wire(Kind::corrupt, 0.1)});
    add({"garbled for long", Fault::sample_stale, 24, wire(Kind::corrupt, 0.1)});
    add({"short", Fault::report_malformed, 3, wire(Kind::short_report, 0.1)});
    add({"long", Fault::report_malformed, 3, wire(Kind::long_report, 0.1)});
    add({"of another id", Fault::report_malformed, 3, wire(Kind::wrong_id, 0.1)});
    add({"frozen", Fault::report_repeated, 3, wire(Kind::freeze, 0.1)});
    add({"frozen for long", Fault::sample_stale, 24, wire(Kind::freeze, 0.1)});
    add({"each report twice", Fault::link_lossy, 60, wire(Kind::repeat, 0.3), {}, not_testing});
    add({"each report after the next", Fault::link_lossy, 60, wire(Kind::swap, 0.3), {}, not_testing});
    add({"every other report lost", Fault::report_missing, 5, wire(Kind::drop_reports, 0.3, 2)});
    add({"every other report lost, for long",
         Fault::link_lossy,
         100,
         wire(Kind::drop_reports, 0.3, 2),
         {},
         not_testing});
    add({"late", Fault::sample_late, 6, wire(Kind::delay_reports, 0.5, 0.008)});
    add({"a moment of silence", Fault::sample_late, 6, wire(Kind::silence, 0.006)});
    add({"silence", Fault::sample_stale, 24, wire(Kind::silence, 0.1)});
    add({"NaN in the position", Fault::pose_not_finite, 1,
         spoil([](DeviceSample& s) { s.X_BH.translation_m.y() = kNaN; })});
    add({"infinity in the position", Fault::pose_not_finite, 1,
         spoil([](DeviceSample& s) { s.X_BH.translation_m.z() = -kInf; })});
    add({"NaN in the orientation", Fault::pose_not_finite, 1,
         spoil([](DeviceSample& s) { s.X_BH.rotation.w() = kNaN; })});
    add({"NaN in the twist", Fault::pose_not_finite, 1,
         spoil([](DeviceSample& s) { s.V_BH.angular_rad_per_s.x() = kNaN; })});
    add({"a quaternion that is none", Fault::pose_not_a_rotation, 5, wire(Kind::bad_quaternion, 0.05)});
    add({"teleported", Fault::pose_jumped, 3, wire(Kind::jump, 0.05)});
    add({"far outside", Fault::pose_outside_workspace, 3, wire(Kind::jump, 0.05, 0.6)});
    add({"stuck", Fault::pose_stuck, 26, [](FaultRig& r) {
           r.faulty_device.corrupt = [X_BH = r.simulated.X_BH()](DeviceSample& s) {
             s.X_BH = X_BH;
             s.V_BH.linear_m_per_s = {0.1, 0, 0};
           };
         }});
    add({"run away", Fault::overspeed, 5, wire(Kind::drift, 0.02), {}, under_way});
    add({"not homed any more", Fault::not_homed, 1, spoil([](DeviceSample& s) { s.homed = false; })});
    add({"the watchdog trips", Fault::watchdog_tripped, 4, wire(Kind::trip_watchdog, 0.002), {}, under_way});
    add({"commands do not arrive",
         Fault::watchdog_tripped,
         14,
         wire(Kind::drop_commands, 0.1),
         {},
         under_way});
    add({"the motors are off", Fault::motors_off, 26, wire(Kind::motors_off, 0.1), {}, [](State s, Phase) {
           return s == State::active;
         }});
    add({"no room for commands", Fault::write_blocked, 4, wire(Kind::reject_commands, 0.1), {}, not_testing});
    add({"no room for commands, for long",
         Fault::write_failed,
         22,
         wire(Kind::reject_commands, 0.1),
         {},
         not_testing});
    add({"a tick late", Fault::tick_late, 1,
         [](FaultRig& r) { r.clock.step(std::chrono::milliseconds(8)); }});
    add({"stopped", Fault::loop_stalled, 1,
         [](FaultRig& r) { r.clock.step(std::chrono::milliseconds(200)); }});
    add({"a clock that goes back", Fault::clock_reversed, 1,
         [](FaultRig& r) { r.clock.step(std::chrono::milliseconds(-3)); }});
    add({"asleep", Fault::suspended, 1, [](FaultRig& r) { r.clock.suspended += std::chrono::hours(1); }});
    add({"a solver out of time", Fault::wrench_late, 1,
         [](FaultRig& r) { r.clock.solver_time = std::chrono::milliseconds(4); }});
    add({"a wrench that is not a number", Fault::wrench_not_finite, 4,
         spoil([](DeviceSample& s) { s.X_BH.translation_m.z() = -1.7e308; })});
    add({"pinned",
         Fault::motors_stalled,
         1200,
         [](FaultRig&) {},
         {},
         [](State s, Phase p) { return s == State::active && p == Phase::saturated; }});
    add({"the client that armed is lost",
         Fault::heartbeat_lost,
         103,
         [](FaultRig& r) { r.loop.requests().arm_with_lease(); },
         {},
         [](State s, Phase p) { return s == State::disarmed && p == Phase::free; }});
    add({"heartbeats stop",
         Fault::heartbeat_missing,
         103,
         [](FaultRig& r) { r.loop.requests().request(kArm | kLease); },
         {},
         [](State s, Phase p) { return s == State::disarmed && p == Phase::free; }});
    add({"the dead man's button",
         Fault::deadman_released,
         1,
         spoil([](DeviceSample& s) { s.buttons &= ~1U; }),
         {},
         armed});
    add({"the stop button", Fault::stop_button, 1,
         spoil([](DeviceSample& s) { s.buttons |= 1U << kStopButton; })});
    add({"a stop is requested", Fault::stop_requested, 1, [](FaultRig& r) { r.loop.requests().stop(); }});
    add({"a fault releases the other hand", Fault::other_hand_released, 1,
         [](FaultRig& r) { r.loop.requests().release_with_other_hand(); }});
    add({"what comes again and again",
         Fault::degraded_too_long,
         560,
         [](FaultRig& r) {
           for (int i = 0; i < 30; ++i)
             r.simulated.inject({Kind::silence,
                                 r.clock.now() - TimePoint{} + i * std::chrono::milliseconds(40),
                                 std::chrono::milliseconds(6)});
         },
         {},
         under_way});
    add({"what comes back too often",
         Fault::degraded_too_often,
         2200,
         [](FaultRig& r) {
           for (int i = 0; i < 12; ++i)
             r.simulated.inject({Kind::silence,
                                 r.clock.now() - TimePoint{} + i * std::chrono::milliseconds(180),
                                 std::chrono::milliseconds(6)});
         },
         {},
         [](State s, Phase p) { return s == State::active && p != Phase::saturated; }});
    const auto testing = [](State s, Phase) { return s == State::self_test; };
    add({"a test that is never clean",
         Fault::self_test_reports,
         5100,
         wire(Kind::drop_reports, 6.0, 10),
         {},
         testing});
    add({"a watchdog that sleeps",
         Fault::self_test_watchdog,
         150,
         wire(Kind::disable_watchdog, 2.0),
         {},
         testing});
    add({"another rate",
         Fault::self_test_rate,
         80,
         spoil([](DeviceSample& s) { s.sequence *= 2; }),
         {},
         testing});
    return list;
  }();
  return all;
}

}  // namespace wrenchd::test
