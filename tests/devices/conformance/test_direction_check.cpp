// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/conformance/device_session.hpp"
#include "devices/conformance/direction_check.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/firmware_in_hand.hpp"
#include "tests/support/firmware_mistakes.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_direction_check {

// The check by pulses on the emulated arms of shipped profiles, with right and wrong profiles, and on the
// firmware reference with the mistakes of a maker.

namespace {

using namespace test;
using namespace std::chrono_literals;
using Catch::Contains;

DeviceProfile shipped(const std::string& name) {
  return load_profile(source_path("config/profiles/" + name + ".toml"), SearchPath({source_path("config")}));
}

SimulationSettings holding_hand() {
  SimulationSettings settings;
  settings.hand_path = {{0.0, {0.01, -0.02, 0.03}, {0.0, 0.0, 0.0}}};
  settings.hand_repeats = false;
  return settings;
}

const RuleResult* find(const std::vector<RuleResult>& results, const std::string& rule) {
  const auto found =
      std::find_if(results.begin(), results.end(), [&](const auto& r) { return r.rule == rule; });
  return found == results.end() ? nullptr : &*found;
}

/// Opens the device and reads it until its poses are valid.
void make_ready(ProfileDevice& device, VirtualClock& clock) {
  device.open();
  for (int i = 0; i < 3000; ++i) {
    clock.sleep_until(clock.now() + 1ms);
    const DeviceSample sample = device.read_newest(clock.now());
    device.write(clock.now(), {}, false);
    if (i > 100 && sample.fresh && sample.homed && device.trusted()) return;
  }
  FAIL("the emulated device sends no valid pose");
}

/// An emulated arm of `built`, which the host takes for a device of `believed`.
struct Arm {
  Arm(const DeviceProfile& built, const DeviceProfile& believed,
      const SimulationSettings& hand = holding_hand())
      : link(make_simulated_link(built, hand, clock)), device(believed, *link) {
    make_ready(device, clock);
  }
  std::vector<RuleResult> check(const std::function<bool()>& cancelled = [] { return false; }) {
    return check_directions(device, clock, cancelled);
  }
  VirtualClock clock;
  std::unique_ptr<SimulatedLink> link;
  ProfileDevice device;
};

void check_wrong(const std::string& name, const std::function<void(DeviceProfile&)>& spoil) {
  INFO(name);
  DeviceProfile wrong = shipped(name);
  spoil(wrong);
  const std::vector<RuleResult> results = Arm(shipped(name), wrong).check();
  REQUIRE(find(results, "force_direction") != nullptr);
  INFO(find(results, "force_direction")->seen);
  CHECK(find(results, "force_direction")->judgement == Judgement::fail);
}

}  // namespace

TEST_CASE("the arms of the shipped profiles pass, in less than three seconds", "[direction_check]") {
  for (const char* name : {"falcon", "polhem", "polhem_lpc1768", "woodenhaptics"}) {
    INFO(name);
    Arm arm(shipped(name), shipped(name));
    const TimePoint start = arm.clock.now();
    const std::vector<RuleResult> results = arm.check();
    CHECK(seconds(arm.clock.now() - start) < 3.0);
    REQUIRE(results.size() == 1);
    INFO(results[0].seen);
    CHECK(results[0].rule == "force_direction");
    CHECK(results[0].judgement == Judgement::pass);
  }
}

TEST_CASE("an arm whose motor is wired the other way fails", "[direction_check]") {
  for (const char* name : {"falcon", "polhem", "woodenhaptics"})
    check_wrong(name, [](DeviceProfile& p) {
      for (double& effort : p.kinematics.effort_per_Nm) effort = -effort;
    });
  check_wrong("woodenhaptics", [](DeviceProfile& p) { p.kinematics.effort_per_Nm[0] *= -1.0; });
  check_wrong("polhem", [](DeviceProfile& p) { p.kinematics.effort_per_Nm[1] *= -1.0; });
}

TEST_CASE("an arm whose motors are swapped fails", "[direction_check]") {
  check_wrong("falcon", [](DeviceProfile& p) {
    std::swap(p.kinematics.report_index[0], p.kinematics.report_index[1]);
  });
}

TEST_CASE("a direction is not called right if the device does not sense all axes that it drives",
          "[direction_check]") {
  SimulationSettings hand = holding_hand();
  VirtualClock clock;
  DeviceProfile blind = reference_profile();
  blind.pose_report.orientation.present = false;
  blind.pose_report.angular_velocity.present = false;
  FirmwareInHand firmware(reference_profile(), hand, {});
  LoopbackLink link(firmware, clock, hand);
  ProfileDevice device(blind, link);
  make_ready(device, clock);
  const std::vector<RuleResult> results = check_directions(device, clock, [] { return false; });
  REQUIRE(find(results, "torque_direction") != nullptr);
  CHECK(find(results, "torque_direction")->judgement == Judgement::not_judged);
  CHECK_THAT(find(results, "torque_direction")->seen, Contains("does not sense rx ry rz"));
  CHECK(find(results, "force_direction")->judgement == Judgement::pass);
}

TEST_CASE("the device is released after the check, and after a cancellation", "[direction_check]") {
  Arm arm(shipped("polhem"), shipped("polhem"));
  arm.check();
  CHECK(arm.link->device().motor_wrench().force_N.norm() == 0.0);
  int calls = 0;
  CHECK_THROWS_AS(arm.check([&calls] { return ++calls > 60; }), SessionCancelled);
  arm.clock.sleep_until(arm.clock.now() + 5ms);
  arm.device.read_newest(arm.clock.now());
  CHECK(arm.link->device().motor_wrench().force_N.norm() == 0.0);
}

TEST_CASE("a device that is unplugged during the check, or has a fault, ends it", "[direction_check]") {
  for (const bool unplugged : {true, false}) {
    Arm arm(shipped("polhem"), shipped("polhem"));
    const Duration now = arm.clock.now() - TimePoint{};
    const auto kind = unplugged ? SimulatedFault::Kind::unplug : SimulatedFault::Kind::silence;
    arm.link->device().inject({kind, now + 200ms, 10s});
    if (unplugged)
      CHECK_THROWS_AS(arm.check(), DeviceDisconnected);
    else
      CHECK_THROWS_WITH(arm.check(), Contains("sample_stale"));
  }
}

namespace {

/// Results for the firmware reference with these mistakes.
std::vector<RuleResult> check_firmware(FirmwareMistakes mistakes = {}) {
  SimulationSettings hand = holding_hand();
  VirtualClock clock;
  FirmwareInHand firmware(reference_profile(), hand, std::move(mistakes));
  LoopbackLink link(firmware, clock, hand);
  ProfileDevice device(reference_profile(), link);
  make_ready(device, clock);
  std::vector<RuleResult> results = check_directions(device, clock, [] { return false; });
  CHECK(firmware.max_force_N() > 0.1);
  CHECK(firmware.max_force_N() <= kMaxPulse_N + 1e-6);
  CHECK(firmware.max_torque_Nm() <= kMaxPulse_Nm + 1e-6);
  return results;
}

void check_mistake(const std::string& rule, FirmwareMistakes mistakes) {
  INFO(rule);
  const std::vector<RuleResult> results = check_firmware(std::move(mistakes));
  REQUIRE(find(results, rule) != nullptr);
  INFO(find(results, rule)->seen);
  CHECK(find(results, rule)->judgement == Judgement::fail);
}

}  // namespace

TEST_CASE("velocities, sequences and acknowledgements are checked where the profile has them",
          "[direction_check]") {
  for (const RuleResult& result : check_firmware()) {
    INFO(result.rule << ": " << result.seen);
    CHECK(result.judgement == Judgement::pass);
  }
  CHECK(check_firmware().size() == 6);
  check_mistake("torque_direction", in_motors([](wf_wrench& w) { w.torque_uNm[2] = -w.torque_uNm[2]; }));
  check_mistake("linear_velocity", in_reports([](ReportBytes& r) {
                  for (std::size_t i = 0; i < 3; ++i)
                    put_i32(r, kVelocity + 4 * i, -i32(r, kVelocity + 4 * i));
                }));
  check_mistake("angular_velocity", in_reports([](ReportBytes& r) {
                  for (std::size_t i = 3; i < 6; ++i) put_i32(r, kVelocity + 4 * i, 0);
                }));
  check_mistake("acknowledged", in_reports([](ReportBytes& r) { r[kAcknowledged] = 0; }));
}

}  // namespace wrenchd::test_direction_check
