// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <optional>
#include <thread>

#include <catch2/catch.hpp>

#include "config/calibration_store.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/devices/usb/mock_device.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/soon.hpp"

namespace wrenchd::test_hot_plug {

// The complete daemon as a process, with a device that is connected and disconnected.

using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Contains;

namespace {

/// The reference device behind a mock hidraw node, on a thread: it sends reports and receives commands. It
/// sends the newest report every 2 ms if the host has read the previous one, because the mock node merges
/// waiting reports.
class LiveHandle final : ReportSink {
 public:
  LiveHandle(MockMachine& machine, const MockIdentity& identity)
      : mock_(machine, identity), device_(reference_profile(), settings()), thread_([this] { live(); }) {}
  ~LiveHandle() { stop(); }

  void unplug() {
    stop();
    mock_.unplug();
  }
  bool was_pushed() const { return pushed_.load(); }
  int commands() const { return commands_.load(); }

 private:
  static SimulationSettings settings() {
    SimulationSettings settings;
    settings.hand_path = {{0.0, {0, 0, 0.03}, {0, 0, 0}}};
    return settings;
  }

  void take_report(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    newest_.assign(report.begin(), report.end());
  }
  void live() {
    while (!stop_.load()) {
      device_.advance_to(std::chrono::steady_clock::now(), *this);
      send();
      while (mock_.anything_received()) {
        device_.take_command(std::chrono::steady_clock::now(), mock_.receive(32));
        ++commands_;
      }
      if (device_.firmware().motors_on()) pushed_.store(true);
      std::this_thread::sleep_for(2ms);
    }
  }
  /// If the node is full, the report is lost.
  void send() {
    try {
      if (!newest_.empty() && !mock_.report_waits()) mock_.send(newest_);
    } catch (const std::runtime_error&) {
    }
  }
  void stop() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }

  MockHidraw mock_;
  SimulatedDevice device_;
  Bytes newest_;
  std::atomic<bool> stop_{false}, pushed_{false};
  std::atomic<int> commands_{0};
  std::thread thread_;
};

/// A mock on a busy machine is slow.
constexpr auto kLimit = 60s;

/// Exit code of wrenchd after a fault. On a busy machine a late tick is a fault.
constexpr int kExitFault = 3;

/// A profile that tolerates any silence of the machine.
const char* const kPatient = R"(inherits = "reference_full_speed"
name = "patient"
stale_fault_s = 1.0
[match]
usb = ["1209:6d0f"]
[pose_report]
sequence = "none"
)";
/// Both tests of the device are off, because a mock on a busy machine cannot pass them.
const char* const kLenient = "[device]\nfirst_test = false\n[servo]\nself_test_s = 0\n";
/// As kLenient, with the test before the first arming.
const char* const kTested = "[servo]\nself_test_s = 0\n";

}  // namespace

TEST_CASE("wrenchd waits for its device and, after it is connected again, is disarmed", "[usb]") {
  const MachineLoad load;
  MockMachine machine;
  const TemporaryDirectory files;
  const std::string profile = files.write("patient.toml", kPatient).string();
  const std::string config = files.write("lenient.toml", kLenient).string();
  RunningProgram wrenchd("wrenchd",
                         {"--config", config, "--profile", profile, "--realtime", "best_effort", "--arm"});
  REQUIRE_RATE(load, wrenchd.wait_for_output("no device of profile patient is connected; waiting for it"));

  std::optional<LiveHandle> handle(std::in_place, machine, MockIdentity{});
  REQUIRE_RATE(load, wrenchd.wait_for_output("device 1209:6d0f serial A1 in 1-1, interface 0 (hidraw)"));
  REQUIRE_RATE(load, soon([&] { return handle->was_pushed(); }, kLimit));  // --arm armed it
  handle->unplug();
  REQUIRE_RATE(load, wrenchd.wait_for_output("device_lost: "));
  handle.reset();

  handle.emplace(machine, MockIdentity{.place = "1-3", .number = 4, .serial = "B2"});
  REQUIRE_RATE(load, wrenchd.wait_for_output(
                         "serial B2 in 1-3, interface 0: it is not the device that was unplugged"));
  CHECK(handle->commands() == 0);
  handle->unplug();
  handle.reset();

  handle.emplace(machine, MockIdentity{.place = "1-4", .number = 6});
  REQUIRE_RATE(load, wrenchd.wait_for_output(
                         "the device is connected again, and is disarmed: 1209:6d0f serial A1 in 1-4"));
  REQUIRE_RATE(load, soon([&] { return handle->commands() > 300; }, kLimit));
  CHECK_FALSE(handle->was_pushed());

  wrenchd.signal(SIGTERM);
  const ProgramResult result = wrenchd.wait();
  INFO(result.err);
  CHECK((result.exit_code == 0 || result.exit_code == kExitFault));
  CHECK_THAT(result.err, Contains("the hand is released"));
  REQUIRE_RATE(load, result.exit_code == 0);
}

TEST_CASE("a device that is unplugged during its first test is waited for", "[usb]") {
  const MachineLoad load;
  MockMachine machine;
  const TemporaryDirectory files;
  const std::string profile = files.write("patient.toml", kPatient).string();
  const std::string config = files.write("tested.toml", kTested).string();
  RunningProgram wrenchd("wrenchd",
                         {"--config", config, "--profile", profile, "--realtime", "best_effort", "--arm"});
  REQUIRE_RATE(load, wrenchd.wait_for_output("waiting for it"));
  std::optional<LiveHandle> handle(std::in_place, machine, MockIdentity{});
  REQUIRE_RATE(load, wrenchd.wait_for_output("the device is tested before it is armed for the first time"));
  handle->unplug();
  REQUIRE_RATE(load, wrenchd.wait_for_output("disconnected before it was ready; waiting for it"));
  handle.reset();
  wrenchd.signal(SIGTERM);
  CHECK(wrenchd.wait().exit_code == 0);
}

TEST_CASE("without a profile name wrenchd selects the profile of the device", "[usb]") {
  const MachineLoad load;
  MockMachine machine;
  const LiveHandle handle(machine, {.vendor = "1209", .product = "0001"});
  RunningProgram wrenchd("wrenchd", {"--profile", "auto", "--realtime", "best_effort"});
  REQUIRE_RATE(load, wrenchd.wait_for_output("device reference_full_speed"));
  REQUIRE_RATE(load, soon([&] { return handle.commands() > 10; }, kLimit));
  wrenchd.signal(SIGTERM);
  CHECK_THAT(wrenchd.wait().err, Contains("senses x y z rx ry rz, drives x y z rx ry rz"));
}

TEST_CASE("a device that requires calibration is not armed before it", "[usb]") {
  const MachineLoad load;
  MockMachine machine;
  const TemporaryDirectory files;
  const std::string profile =
      files.write("patient.toml", std::string(kPatient) + "[homing]\ncheck_axes = true\n").string();
  const std::string config = files.write("lenient.toml", kLenient).string();
  const CalibrationStore store(files.path() / "calibration");
  const bool calibrated = GENERATE(false, true);
  if (calibrated) store.write({"patient", "A1", {}});
  setenv("STATE_DIRECTORY", files.path().c_str(), 1);
  const LiveHandle handle(machine, {});
  const std::string socket = (files.path() / "control.sock").string();
  RunningProgram wrenchd("wrenchd", {"--config", config, "--profile", profile, "--realtime", "best_effort",
                                     "--arm", "--control", socket});
  unsetenv("STATE_DIRECTORY");
  if (calibrated) {
    REQUIRE_RATE(load, soon([&] { return handle.was_pushed(); }, kLimit));
  } else {
    REQUIRE_RATE(load, wrenchd.wait_for_output(
                           "cannot be armed: it is not calibrated; run wrenchctl calibrate patient"));
    REQUIRE_RATE(load, soon([&] { return handle.commands() > 300; }, kLimit));
    const ProgramResult armed = run_program("wrenchctl", {"arm", "--socket", socket});
    CHECK(armed.exit_code == 1);
    CHECK_THAT(armed.err, Contains("it is not calibrated; run wrenchctl calibrate patient"));
    CHECK_FALSE(handle.was_pushed());
  }
  wrenchd.signal(SIGTERM);
  const int exit_code = wrenchd.wait().exit_code;
  CHECK((exit_code == 0 || exit_code == kExitFault));
  REQUIRE_RATE(load, exit_code == 0);
}

TEST_CASE("wrenchctl calibrate asks for the axes and stores nothing if it is stopped", "[usb]") {
  const MachineLoad load;
  MockMachine machine;
  const TemporaryDirectory files;
  const std::string profile = files.write("patient.toml", kPatient).string();
  setenv("STATE_DIRECTORY", files.path().c_str(), 1);
  const LiveHandle handle(machine, {});
  RunningProgram wrenchctl("wrenchctl", {"calibrate", profile});
  unsetenv("STATE_DIRECTORY");
  REQUIRE_RATE(load, soon(
                         [&] {
                           return wrenchctl.out().find("Push the handle straight away from you.") !=
                                  std::string::npos;
                         },
                         kLimit));
  wrenchctl.signal(SIGINT);
  const ProgramResult result = wrenchctl.wait();
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Contains("cancelled; no calibration was stored"));
  CHECK_FALSE(std::filesystem::exists(files.path() / "calibration"));
  CHECK_FALSE(handle.was_pushed());
}

}  // namespace wrenchd::test_hot_plug
