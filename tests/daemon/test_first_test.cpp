// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "daemon/first_test.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/conformance/conformance.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/device_process.hpp"
#include "tests/support/firmware_in_hand.hpp"
#include "tests/support/firmware_mistakes.hpp"
#include "tests/support/firmware_process.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_first_test {

// The test of a device before it is armed for the first time, with the firmware reference of
// devices/firmware/ as it is, and with the mistakes of a maker around it.

using namespace wrenchd::test;
using Catch::Contains;

namespace {

/// A hand that holds the handle and does not move it.
SimulationSettings holding_hand() {
  SimulationSettings settings;
  settings.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0.1, 0.0, 0.2}}};
  settings.hand_repeats = false;
  return settings;
}

/// A handle that does not move by the pulses.
SimulationSettings clamped() {
  SimulationSettings settings = holding_hand();
  settings.coulomb_friction_N = 3.0;
  settings.coulomb_friction_Nm = 0.1;
  return settings;
}

struct Bench {
  explicit Bench(FirmwareMistakes mistakes = {}, const SimulationSettings& hand = holding_hand())
      : device(reference_profile(), hand, std::move(mistakes)),
        link(device, clock, hand),
        tested(files.path()) {
    config.profile = reference_profile();
    config.simulated = false;
    usb.serial = "A1";
  }
  std::optional<std::string> run(const StopCondition& stop = [] { return false; }) {
    return run_first_test(
        config, link, &usb, clock, stop, [](const std::string&) {}, tested);
  }
  bool needed() const { return needs_first_test(config, &usb, tested); }

  const TemporaryDirectory files;
  VirtualClock clock;
  FirmwareInHand device;
  LoopbackLink link;
  RunConfig config;
  UsbDevice usb;
  TestedDevices tested;
};

void check_rejected(const std::string& rule, FirmwareMistakes mistakes) {
  INFO(rule);
  Bench bench(std::move(mistakes));
  const std::string obstacle = bench.run().value();
  CHECK_THAT(obstacle, Contains(rule));
  CHECK_THAT(obstacle, Contains("correct its firmware or its profile"));
  CHECK(bench.needed());
  CHECK(bench.device.max_force_N() <= kMaxPulse_N + 1e-6);
  CHECK(bench.device.max_torque_Nm() <= kMaxPulse_Nm + 1e-6);
}

}  // namespace

TEST_CASE("a right device passes its first test, and is not tested again", "[first_test]") {
  Bench bench;
  CHECK(bench.needed());
  const TimePoint start = bench.clock.now();
  CHECK(bench.run() == "");
  CHECK(seconds(bench.clock.now() - start) < 3.0);
  CHECK(bench.device.max_force_N() > 0.1);
  CHECK(bench.device.max_force_N() <= kMaxPulse_N + 1e-6);
  CHECK_FALSE(bench.needed());
  bench.usb.serial = "B2";
  CHECK(bench.needed());
}

TEST_CASE("a device with a mistake fails its first test, which names the rule", "[first_test]") {
  check_rejected("force_direction", in_motors([](wf_wrench& w) {
                   for (std::int32_t& f : w.force_uN) f = -f;
                 }));
  check_rejected("force_direction", in_motors([](wf_wrench& w) { std::swap(w.force_uN[0], w.force_uN[1]); }));
  check_rejected("torque_direction", in_motors([](wf_wrench& w) { w.torque_uNm[2] = -w.torque_uNm[2]; }));
  check_rejected("torque_direction", in_reports([](ReportBytes& r) {  // w first
                   std::rotate(r.begin() + kOrientation, r.begin() + kOrientation + 12,
                               r.begin() + kOrientation + 16);
                 }));
  check_rejected("linear_velocity", in_reports([](ReportBytes& r) {
                   for (std::size_t i = 0; i < 3; ++i)
                     put_i32(r, kVelocity + 4 * i, -i32(r, kVelocity + 4 * i));
                 }));
  check_rejected("linear_velocity", in_reports([](ReportBytes& r) {
                   for (std::size_t i = 0; i < 3; ++i) put_i32(r, kVelocity + 4 * i, 0);
                 }));
  check_rejected("angular_velocity", in_reports([](ReportBytes& r) {
                   for (std::size_t i = 3; i < 6; ++i)
                     put_i32(r, kVelocity + 4 * i, -i32(r, kVelocity + 4 * i));
                 }));
  check_rejected("acknowledged", in_reports([](ReportBytes& r) { r[kAcknowledged] = 0; }));
  check_rejected("quaternion_norm", in_reports([](ReportBytes& r) {
                   for (std::size_t i = 0; i < 4; ++i)
                     put_i32(r, kOrientation + 4 * i, i32(r, kOrientation + 4 * i) / 2);
                 }));
}

TEST_CASE("a device whose force cannot be seen may be armed, and is tested again", "[first_test]") {
  Bench bench({}, clamped());
  CHECK(bench.run() == "");
  CHECK(bench.needed());
}

TEST_CASE("a signal ends the first test without a result", "[first_test]") {
  Bench bench;
  CHECK_FALSE(bench.run([&] { return seconds(bench.clock.now().time_since_epoch()) > 0.4; }));
  CHECK(bench.needed());
}

TEST_CASE("a device without valid reports fails its first test", "[first_test]") {
  FirmwareMistakes mistakes;
  mistakes.report = [](ReportBytes& r) { r.assign(3, 0); };
  Bench bench(std::move(mistakes));
  CHECK(bench.run() != "");
  CHECK(bench.needed());
}

TEST_CASE(
    "only devices with motors are tested, by the test of their layout, if the configuration asks for it",
    "[first_test]") {
  Bench bench;
  const auto needs_pulses = [&] { return needs_direction_test(bench.config, &bench.usb, bench.tested); };
  CHECK_FALSE(needs_pulses());
  bench.config.settings.device.first_test = false;
  CHECK_FALSE(bench.needed());
  bench.config.settings.device.first_test = true;
  bench.config.profile.pose_report.position.byte = 9;
  CHECK_FALSE(bench.needed());
  CHECK(needs_pulses());
  bench.config.settings.device.first_test = false;
  CHECK_FALSE(needs_pulses());
  bench.config.settings.device.first_test = true;
  bench.config.profile.has_output = false;
  CHECK_FALSE(needs_pulses());
}

TEST_CASE("a rule that failed once must pass in the second test, not merely escape judgement",
          "[first_test]") {
  // The force is inverted for the first pulses; in the second test the motors move nothing.
  int pulses = 0;
  Bench bench(in_motors([&pulses](wf_wrench& w) {
    const bool on = w.force_uN[0] != 0 || w.force_uN[1] != 0 || w.force_uN[2] != 0;
    if (on) ++pulses;
    constexpr int kOfFirstTest = 8'000;  // periods of the motor context, 16 a millisecond
    for (std::int32_t& f : w.force_uN) f = pulses < kOfFirstTest ? -f : 0;
  }));
  CHECK_THAT(bench.run().value(), Contains("force_direction"));
  CHECK(pulses > 8'000);
  CHECK(bench.needed());
}

TEST_CASE("wrenchd arms no device whose force is inverted, neither by an option nor for a client",
          "[first_test][wall_time]") {
  const MachineLoad load;
  const TemporaryDirectory files;
  const std::string socket = (files.path() / "control.sock").string();
  for (const bool good : {true, false}) {
    FirmwareMistakes inverted = in_motors([](wf_wrench& w) {
      for (std::int32_t& f : w.force_uN) f = -f;
    });
    const FirmwareProcess device(holding_hand(), good ? FirmwareMistakes{} : inverted);
    RunningProgram wrenchd(
        "wrenchd", {"--profile", source_path("config/profiles/reference_full_speed.toml"), "--link-fd",
                    device.socket(), "--realtime", "best_effort", "--control", socket, "--arm"});
    if (good) {
      REQUIRE_RATE(load, wrenchd.wait_for_output("active"));
    } else {
      REQUIRE_RATE(load, wrenchd.wait_for_output("the device cannot be armed: it failed the test"));
      const auto status = [&] { return run_program("wrenchctl", {"status", "--socket", socket}).out; };
      for (int i = 0; i < 100 && status().find("cannot be armed") == std::string::npos; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      CHECK_THAT(status(), Contains("cannot be armed"));
      const ProgramResult armed = run_program("wrenchctl", {"arm", "--socket", socket});
      CHECK(armed.exit_code == 1);
      CHECK_THAT(armed.err, Contains("force_direction"));
      CHECK(device.max_force_N() <= kMaxPulse_N + 1e-6);
    }
    wrenchd.signal(SIGTERM);
    wrenchd.wait();
  }
}

// --- devices with other report layouts --------------------------------------------------------------------

namespace {

DeviceProfile shipped(const std::string& name) {
  return load_profile(source_path("config/profiles/" + name + ".toml"), SearchPath({source_path("config")}));
}

DeviceProfile inverted(DeviceProfile profile) {
  for (double& effort : profile.kinematics.effort_per_Nm) effort = -effort;
  return profile;
}

/// An emulated arm of the shipped profile, opened with a right or wrong profile.
struct ArmBench {
  ArmBench(const DeviceProfile& built, const DeviceProfile& believed,
           const SimulationSettings& hand = holding_hand())
      : link(make_simulated_link(built, hand, clock)), device(believed, *link), tested(files.path()) {
    config.profile = believed;
    config.simulated = false;
    usb.serial = "F1";
    device.open();
  }
  std::optional<std::string> run(const StopCondition& stop = [] { return false; }) {
    return run_direction_test(
        config, device, &usb, clock, stop, [this](const std::string& text) { waited.push_back(text); },
        tested);
  }
  bool needed() const { return needs_direction_test(config, &usb, tested); }

  const TemporaryDirectory files;
  VirtualClock clock;
  std::unique_ptr<SimulatedLink> link;
  ProfileDevice device;
  RunConfig config;
  UsbDevice usb;
  TestedDevices tested;
  std::vector<std::string> waited;
};

}  // namespace

TEST_CASE("a Falcon, a Polhem and a WoodenHaptics pass the test by pulses, and are not tested again",
          "[first_test]") {
  for (const char* name : {"falcon", "polhem", "woodenhaptics"}) {
    INFO(name);
    ArmBench bench(shipped(name), shipped(name));
    CHECK(bench.needed());
    CHECK(bench.run() == "");
    CHECK_FALSE(bench.needed());
    CHECK(bench.link->device().motor_wrench().force_N.norm() == 0.0);
  }
}

TEST_CASE("a device of another layout whose force is inverted cannot be armed", "[first_test]") {
  for (const char* name : {"falcon", "polhem", "woodenhaptics"}) {
    INFO(name);
    ArmBench bench(shipped(name), inverted(shipped(name)));
    const auto obstacle = bench.run();
    REQUIRE(obstacle);
    CHECK_THAT(*obstacle, Contains("force_direction") && Contains("the sign is inverted") &&
                              Contains("correct its profile"));
    CHECK(bench.needed());
    CHECK(bench.link->device().motor_wrench().force_N.norm() == 0.0);
  }
}

TEST_CASE("the test by pulses waits until a person has homed the device", "[first_test]") {
  ArmBench bench(shipped("falcon"), shipped("falcon"));
  CHECK(bench.run() == "");
  REQUIRE(bench.waited.size() == 2);
  CHECK_THAT(bench.waited[0], Contains("not homed"));
  CHECK_THAT(bench.waited[1], Contains("is tested"));
}

TEST_CASE("an arm whose force cannot be seen may be armed, and is tested again", "[first_test]") {
  ArmBench bench(shipped("polhem"), shipped("polhem"), clamped());
  CHECK(bench.run() == "");
  CHECK(bench.needed());
}

TEST_CASE("the test by pulses ends without a result if the device is lost, or at a signal", "[first_test]") {
  ArmBench lost(shipped("polhem"), shipped("polhem"));
  lost.link->device().inject(
      {SimulatedFault::Kind::unplug, std::chrono::milliseconds(300), std::chrono::hours(1)});
  CHECK_FALSE(lost.run());
  ArmBench stopped(shipped("polhem"), shipped("polhem"));
  CHECK_FALSE(stopped.run([&] { return seconds(stopped.clock.now().time_since_epoch()) > 0.4; }));
  CHECK(stopped.needed());
}

TEST_CASE("a device that sends nothing valid cannot be tested, so it cannot be armed", "[first_test]") {
  ArmBench bench(shipped("polhem"), shipped("polhem"));
  bench.link->device().inject({SimulatedFault::Kind::silence, Duration{0}, std::chrono::hours(1)});
  const auto obstacle = bench.run();
  REQUIRE(obstacle);
  CHECK_THAT(*obstacle, Contains("sends no valid pose") && Contains("plug it in again"));
}

TEST_CASE("wrenchd arms no arm in another process whose force is inverted", "[first_test][wall_time]") {
  const MachineLoad load;
  const TemporaryDirectory files;
  for (const bool good : {true, false}) {
    WallClock clock;
    DeviceProfile built = shipped("falcon");
    const auto link = make_simulated_link(good ? built : inverted(built), holding_hand(), clock);
    DeviceInHand& falcon = link->device();
    falcon.open(clock.now());
    std::atomic<double> max_force_N{0.0};
    const DeviceProcess process(
        falcon, [&] { max_force_N = std::max(max_force_N.load(), falcon.motor_wrench().force_N.norm()); });
    RunningProgram wrenchd("wrenchd", {"--profile", source_path("config/profiles/falcon.toml"), "--link-fd",
                                       process.socket(), "--realtime", "best_effort", "--control",
                                       (files.path() / "control.sock").string(), "--arm"});
    if (good) {
      REQUIRE_RATE(load, wrenchd.wait_for_output("active"));
    } else {
      REQUIRE_RATE(load, wrenchd.wait_for_output("the device cannot be armed: it failed the test"));
      CHECK(max_force_N <= kMaxPulse_N + 1e-6);
    }
    wrenchd.signal(SIGTERM);
    wrenchd.wait();
  }
}

}  // namespace wrenchd::test_first_test
