// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/fault.hpp"
#include "daemon/servo/demand.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "daemon/servo/wait_reason.hpp"
#include "daemon/wait_text.hpp"
#include "devices/device.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_wait_reason {

using namespace wrenchd::test;
using Kind = WaitReason::Kind;

namespace {

constexpr TimePoint kNow{std::chrono::seconds(100)};

/// A hand that may be armed: every condition holds.
struct Calm {
  DeviceSample sample;
  Demand demand;
  FaultSet faults = 0;

  Calm() {
    sample.arrived = kNow - std::chrono::milliseconds(1);
    sample.homed = true;
    demand.contact.initialization = ProxyInitialization::complete;
    demand.calm.proxy_valid = demand.calm.sampled = true;
    demand.calm.max_force_N = 0.6;
    demand.calm.max_torque_Nm = 0.03;
  }
  WaitReason reason(State state = State::waiting) const {
    return wait_reason(state, faults, sample, demand, kNow);
  }
};

std::string text(const Calm& calm) {
  return wait_text(calm.reason());
}

/// Texts of the events `waits` of a run with the shipped scene, in which the hand holds the handle at one
/// height.
std::vector<std::string> waits_at(double height_m, WaitReason& last) {
  RunConfig plan = shipped_config();
  plan.settings.simulation.hand_path = {{0.0, {0.0, 0.0, height_m}}};
  plan.settings.simulation.hand_repeats = false;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  s.run(3.0);
  std::vector<std::string> texts;
  Event event;
  while (s.runtime.loop().telemetry().events().pop(event))
    if (const auto* waits = std::get_if<Event::Waits>(&event.data)) texts.push_back(wait_text(waits->reason));
  last = s.runtime.loop().telemetry().wait_reason();
  return texts;
}

}  // namespace

TEST_CASE("a calm hand waits for nothing, and no other state waits", "[wait_reason]") {
  Calm calm;
  CHECK(calm.demand.calm.holds());
  CHECK(calm.reason().kind == Kind::none);
  calm.demand.calm.force_N = 6.1;
  CHECK(calm.reason().kind == Kind::contact_pushes);
  for (const State state : {State::disconnected, State::disarmed, State::ramping, State::active,
                            State::degraded, State::releasing, State::fault, State::stopped, State::shutdown})
    CHECK(calm.reason(state).kind == Kind::none);
}

TEST_CASE("the reason is the first condition that does not hold, with its numbers", "[wait_reason]") {
  Calm calm;
  SECTION("the contacts would push: how far the handle must move, in words") {
    calm.demand.calm.force_N = 6.1;
    calm.demand.calm.to_proxy_W_m = {0.0, 0.0, 0.0298};
    CHECK(text(calm) == "arming would push 6.1 N, at most 0.6 N is allowed: move the handle 30 mm up (+z)");
    calm.demand.calm.to_proxy_W_m = {-0.012, 0.0, 0.001};
    CHECK(text(calm).find("13 mm back (-x)") != std::string::npos);
    calm.demand.calm.to_proxy_W_m = {0.010, 0.020, -0.005};
    CHECK(text(calm).find("by (10, 20, -5) mm in x, y, z of the world") != std::string::npos);
  }
  SECTION("the contacts would twist") {
    calm.demand.calm.torque_Nm = 0.250;
    calm.demand.calm.to_proxy_rad = 0.2;
    CHECK(calm.reason().kind == Kind::contact_twists);
    CHECK(text(calm).find("arming would twist 250 mN.m, at most 30 mN.m") == 0);
    CHECK(text(calm).find("turn it 12 deg") != std::string::npos);
  }
  SECTION("a wrench without a contact: a local model pushes") {
    calm.demand.calm.force_N = 1.0;
    CHECK(text(calm).find("local model") != std::string::npos);
  }
  SECTION("a wrench that is not a number is not small") {
    calm.demand.calm.force_N = std::nan("");
    CHECK_FALSE(calm.demand.calm.holds());
    CHECK(calm.reason().kind == Kind::contact_pushes);
  }
  SECTION("the handle moves") {
    calm.demand.calm.speed_m_per_s = 0.12;
    calm.demand.calm.force_N = 6.1;  // a hand in motion must stop first
    CHECK(text(calm) == "the handle moves at 0.12 m/s: hold it below 0.05 m/s");
  }
  SECTION("the handle turns") {
    calm.demand.calm.angular_speed_rad_per_s = 1.0;
    CHECK(text(calm) == "the handle turns at 1.0 rad/s: hold it below 0.5 rad/s");
  }
  SECTION("the proxy is searched for, or has no room") {
    calm.demand.calm.proxy_valid = false;
    calm.demand.contact.initialization = ProxyInitialization::searching;
    CHECK(calm.reason().kind == Kind::proxy_search);
    calm.demand.contact.initialization = ProxyInitialization::failed;
    CHECK(calm.reason().kind == Kind::no_room);
    CHECK(text(calm).find("does not fit") != std::string::npos);
  }
  SECTION("the device is silent, in the self-test too") {
    calm.sample.arrived = kNow - std::chrono::milliseconds(320);
    CHECK(text(calm).find("no report from the device for 0.3 s") == 0);
    CHECK(calm.reason(State::self_test).kind == Kind::no_report);
    calm.sample.arrived = TimePoint{};
    CHECK(text(calm).find("no report has arrived") == 0);
  }
  SECTION("the device is not homed") {
    calm.sample.homed = false;
    CHECK(calm.reason(State::self_test).kind == Kind::not_homed);
  }
  SECTION("a fault that does not latch, with its cure; one for information is no reason") {
    calm.faults = bit(Fault::report_missing);
    CHECK(calm.reason().kind == Kind::none);
    calm.faults |= bit(Fault::deadman_released);
    CHECK(calm.reason().fault == Fault::deadman_released);
    CHECK(text(calm).find(fault_row(Fault::deadman_released).cure) != std::string::npos);
  }
}

TEST_CASE("a hand that stands in the table reads after a second, once, how to get out", "[wait_reason]") {
  WaitReason last;
  const std::vector<std::string> texts = waits_at(0.0055, last);  // the cube would rest at 25 mm
  REQUIRE(texts.size() == 1);
  INFO(texts[0]);
  CHECK(texts[0].find("arming would push") == 0);
  CHECK(texts[0].find("move the handle 20 mm up (+z)") != std::string::npos);
  CHECK(last.kind == Kind::contact_pushes);
  CHECK(last.value == Approx(600.0 * 0.0195).epsilon(0.05));
  CHECK(waits_at(0.065, last).empty());  // above the table it arms
  CHECK(last.kind == Kind::none);
}

TEST_CASE("every state without force says why, and what changes that", "[wait_reason]") {
  DeviceProfile profile = shipped_config().profile;
  const auto text = [&](State state, Fault cause = Fault::none) {
    return no_force_text(state, cause, {}, profile);
  };
  CHECK(text(State::disarmed).find("wrenchctl arm") != std::string::npos);
  CHECK(text(State::disconnected).find(profile.name) != std::string::npos);
  CHECK(text(State::fault, Fault::overspeed).find(fault_row(Fault::overspeed).message) != std::string::npos);
  CHECK(text(State::fault, Fault::overspeed).find("acknowledge") != std::string::npos);
  CHECK(text(State::stopped, Fault::stop_requested).find("acknowledge") != std::string::npos);
  CHECK_FALSE(text(State::self_test).empty());
  CHECK(text(State::active).empty());
  profile.has_output = false;
  CHECK(text(State::active).find("no motors") != std::string::npos);
}

}  // namespace wrenchd::test_wait_reason
