// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/conformance/conformance.hpp"
#include "devices/conformance/device_session.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/firmware_in_hand.hpp"
#include "tests/support/firmware_mistakes.hpp"
#include "tests/support/firmware_process.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tools/conform.hpp"

namespace wrenchd::test_conformance {

// wrenchctl conform against the firmware reference of devices/firmware/, as it is and with the mistakes of a
// maker around it. The firmware itself has no switch for mistakes.

namespace {

using namespace test;
using namespace std::chrono_literals;
using Catch::Contains;
using Rules = std::set<std::string>;

/// The hand rests, moves and turns the handle along all axes from 1.2 s to 2.7 s, then rests.
SimulationSettings hand() {
  SimulationSettings s;
  s.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0.1, 0.0, 0.2}},
                 {1.2, {0.0, 0.0, 0.05}, {0.1, 0.0, 0.2}},
                 {1.7, {0.03, 0.02, 0.08}, {0.3, 0.25, 0.4}},
                 {2.2, {-0.02, -0.03, 0.03}, {-0.2, -0.1, -0.3}},
                 {2.7, {0.0, 0.0, 0.05}, {0.1, 0.0, 0.2}}};
  s.hand_repeats = false;
  return s;
}

/// Rules that a device without USB cannot be judged by, and rules that no host can judge safely.
const Rules kNeverJudged = {"report_descriptor", "usb_id", "serial_number", "saturation", "newest_only"};

struct Run {
  explicit Run(FirmwareMistakes mistakes = {}, const DeviceProfile& of_device = reference_profile(),
               const SimulationSettings& settings = hand())
      : device(of_device, settings, std::move(mistakes)), link(device, clock, settings) {}

  void check(const ConformanceOptions& options = {}) {
    const ConformanceUser user = {[this](const std::string& text) { instructions.push_back(text); },
                                  [this] { return cancelled && cancelled(); }};
    results = check_conformance(profile, link, usb, clock, user, options);
  }
  Rules with(Judgement judgement) const {
    Rules rules;
    for (const RuleResult& r : results)
      if (r.judgement == judgement) rules.insert(r.rule);
    return rules;
  }
  const RuleResult& of(const std::string& rule) const {
    const auto found =
        std::find_if(results.begin(), results.end(), [&](const RuleResult& r) { return r.rule == rule; });
    REQUIRE(found != results.end());
    return *found;
  }
  /// Advances the device until all commands in transit have arrived.
  void settle() { link.advance_to(clock.now() + 5ms); }

  DeviceProfile profile = reference_profile();
  const UsbDevice* usb = nullptr;
  VirtualClock clock;
  FirmwareInHand device;
  LoopbackLink link;
  std::function<bool()> cancelled;
  std::vector<std::string> instructions;
  std::vector<RuleResult> results;
};

/// Runs the check with mistakes and returns the failed rules.
Rules failed_with(FirmwareMistakes mistakes) {
  Run run(std::move(mistakes));
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.device.max_force_N() <= kMaxPulse_N + 1e-6);
  CHECK(run.device.max_torque_Nm() <= kMaxPulse_Nm + 1e-6);
  UNSCOPED_INFO(conformance_text(run.results));
  return run.with(Judgement::fail);
}

bool valid(const CommandBytes& bytes) {
  CommandBytes copy = bytes;
  if (copy.size() != WF_WRENCH_REPORT_BYTES) return false;
  seal(copy);
  return copy == bytes;
}
/// Distance of a command ahead of the last accepted one.
std::uint16_t ahead(const CommandBytes& bytes, const wf_firmware& core) {
  return static_cast<std::uint16_t>(u16(bytes, 2) - core.last_sequence);
}

}  // namespace

TEST_CASE("the firmware reference conforms: every rule that can be judged passes", "[conform]") {
  Run run;
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail).empty());
  CHECK(run.with(Judgement::not_judged) == kNeverJudged);
  CHECK(run.device.max_force_N() == Approx(kMaxPulse_N));
  CHECK(run.device.max_torque_Nm() == Approx(kMaxPulse_Nm));
  run.settle();
  CHECK_FALSE(run.device.firmware().motors_on);
  CHECK_FALSE(run.device.firmware().watchdog_tripped);
  CHECK(run.clock.now() < TimePoint{} + 15s);
  REQUIRE(run.instructions.size() == 3);
}

TEST_CASE("the firmware reference conforms at 8 kHz", "[conform]") {
  DeviceProfile fast = reference_profile();
  fast.report_rate_Hz = 8000.0;
  SimulationSettings settings = hand();
  Run run({}, fast, settings);
  run.profile = fast;
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail).empty());
  CHECK(run.with(Judgement::not_judged) == kNeverJudged);
}

TEST_CASE("conform names an inverted force and torque, and swapped axes", "[conform]") {
  CHECK(failed_with(in_motors([](wf_wrench& w) {
          for (std::int32_t& f : w.force_uN) f = -f;
        })) == Rules{"force_direction"});
  CHECK(failed_with(in_motors([](wf_wrench& w) {
          for (std::int32_t& t : w.torque_uNm) t = -t;
        })) == Rules{"torque_direction"});
  CHECK(failed_with(in_motors([](wf_wrench& w) { w.force_uN[1] = -w.force_uN[1]; })) ==
        Rules{"force_direction"});
  CHECK(failed_with(in_motors([](wf_wrench& w) { std::swap(w.force_uN[0], w.force_uN[1]); })) ==
        Rules{"force_direction"});
}

TEST_CASE("conform names a velocity that is always zero", "[conform]") {
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          for (std::size_t i = 0; i < 6; ++i) put_i32(r, kVelocity + 4 * i, 0);
        })) == Rules{"linear_velocity", "angular_velocity"});
  CHECK(failed_with(in_reports([](ReportBytes& r) { put_i32(r, kVelocity + 4, 0); })) ==
        Rules{"linear_velocity"});
}

TEST_CASE("conform names a velocity of the wrong sign, axis or scale", "[conform]") {
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          for (std::size_t i = 0; i < 3; ++i) put_i32(r, kVelocity + 4 * i, -i32(r, kVelocity + 4 * i));
        })) == Rules{"linear_velocity"});
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          for (std::size_t i = 3; i < 6; ++i) put_i32(r, kVelocity + 4 * i, -i32(r, kVelocity + 4 * i));
        })) == Rules{"angular_velocity"});
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          const std::int32_t x = i32(r, kVelocity), y = i32(r, kVelocity + 4);
          put_i32(r, kVelocity, y), put_i32(r, kVelocity + 4, x);
        })) == Rules{"linear_velocity"});
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          for (std::size_t i = 0; i < 3; ++i) put_i32(r, kVelocity + 4 * i, i32(r, kVelocity + 4 * i) / 2);
        })) == Rules{"linear_velocity"});
}

TEST_CASE("conform names a quaternion with w first", "[conform]") {
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          std::rotate(r.begin() + kOrientation, r.begin() + kOrientation + 12, r.begin() + kOrientation + 16);
        })) == Rules{"quaternion_order"});
}

TEST_CASE("conform names a quaternion that is not of unit length", "[conform]") {
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          for (std::size_t i = 0; i < 4; ++i)
            put_i32(r, kOrientation + 4 * i, i32(r, kOrientation + 4 * i) / 2);
        })) == Rules{"quaternion_norm"});
}

TEST_CASE("conform names a device that does not acknowledge", "[conform]") {
  for (const std::uint8_t constant : {std::uint8_t{0}, std::uint8_t{155}})
    CHECK(failed_with(in_reports([constant](ReportBytes& r) { r[kAcknowledged] = constant; })) ==
          Rules{"acknowledged"});
}

TEST_CASE("conform names a wrong checksum of the reports, and writes nothing", "[conform]") {
  FirmwareMistakes m;
  m.report = [](ReportBytes& r) { std::swap(r[62], r[63]); };  // big-endian
  Run run(m);
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail) == Rules{"report_checksum"});
  CHECK(run.device.commands() == 0);
}

TEST_CASE("conform names a sequence that does not advance, and writes nothing", "[conform]") {
  Run run(in_reports([](ReportBytes& r) { r[2] = r[3] = 7; }));
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail) == Rules{"sequence"});
  CHECK(run.device.commands() == 0);
}

TEST_CASE("conform names reports of a wrong length and a silent device, and writes nothing", "[conform]") {
  FirmwareMistakes longer;
  longer.report = [](ReportBytes& r) { r.pop_back(); };
  FirmwareMistakes silent;
  silent.report = [](ReportBytes& r) { r.clear(); };
  for (const FirmwareMistakes& m : {longer, silent}) {
    Run run(m);
    run.check();
    CHECK(run.with(Judgement::fail) == Rules{"report_frame"});
    CHECK(run.device.commands() == 0);
  }
}

TEST_CASE("conform names a missing watchdog, and applies no force without one", "[conform]") {
  FirmwareMistakes m;
  // The motor context sees the time of the last command, so that no command becomes old.
  auto accepted_us = std::make_shared<std::uint32_t>(0);
  m.command = [accepted_us](CommandBytes&, wf_firmware&) { *accepted_us = 0; };
  m.motor_clock = [accepted_us](std::uint32_t now_us) {
    if (*accepted_us == 0) *accepted_us = now_us;
    return *accepted_us;
  };
  Run run(m);
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail) == Rules{"watchdog"});
  CHECK(run.of("force_direction").judgement == Judgement::not_judged);
  CHECK(run.device.max_force_N() == 0.0);
  run.settle();
  CHECK_FALSE(run.device.firmware().motors_on);  // released all the same
}

TEST_CASE("conform names a hold time that is ignored", "[conform]") {
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware&) {
          if (!valid(c)) return;
          c[28] = 0xE8, c[29] = 0x03;
          seal(c);
        })) == Rules{"hold_time"});
}

TEST_CASE("conform names commands that should have been rejected", "[conform]") {
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware&) {
          if (c.size() == WF_WRENCH_REPORT_BYTES && c[0] == 0x02) seal(c);
        })) == Rules{"command_checksum"});
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware&) {
          if (c.size() == WF_WRENCH_REPORT_BYTES - 1) c.push_back(0), seal(c);
        })) == Rules{"command_length"});
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware&) {
          if (valid(c)) c[0] = 0x02, seal(c);
        })) == Rules{"command_id"});
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware& core) {
          if (valid(c) && ahead(c, core) == 0) --core.last_sequence;
        })) == Rules{"repeated_command"});
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware& core) {
          if (valid(c) && ahead(c, core) > 32767)
            core.last_sequence = static_cast<std::uint16_t>(u16(c, 2) - 1);
        })) == Rules{"old_command"});
}

TEST_CASE("conform names commands that should have been accepted", "[conform]") {
  const auto reject = [](CommandBytes& c) { c[30] ^= 0xFFU; };
  CHECK(failed_with(in_commands([reject](CommandBytes& c, wf_firmware& core) {
          if (valid(c) && !core.motors_on && core.command_accepted && ahead(c, core) > 32767) reject(c);
        })) == Rules{"restarted_host"});
  CHECK(failed_with(in_commands([reject](CommandBytes& c, wf_firmware& core) {
          if (valid(c) && core.motors_on && u16(c, 2) < core.last_sequence)
            reject(c);  // compared without wrap
        })) == Rules{"sequence_wraps"});
}

TEST_CASE("conform names wrong status bits", "[conform]") {
  const auto set = [](ReportBytes& r, unsigned mask) { r[1] = static_cast<std::uint8_t>(r[1] | mask); };
  CHECK(failed_with(in_reports([](ReportBytes& r) { r[1] &= 0xFEU; })) == Rules{"motors_follow_enable"});
  CHECK(failed_with(in_reports([set](ReportBytes& r) {
          if ((r[1] & 1U) == 0) set(r, 2);
        })) == Rules{"no_trip_at_enable_0"});
  CHECK(failed_with(in_reports([set](ReportBytes& r) { set(r, 0x10); })) == Rules{"unused_bits"});
  CHECK(failed_with(in_commands([](CommandBytes& c, wf_firmware& core) {
          if (valid(c)) core.watchdog_tripped = false;
        })) == Rules{"tripped_bit"});
  CHECK(failed_with(in_reports([](ReportBytes& r) { r[1] &= 0xFDU; })) == Rules{"watchdog"});
}

TEST_CASE("conform names a device that is on before the first command", "[conform]") {
  FirmwareMistakes m = in_reports([](ReportBytes& r) { r[1] |= 1U; });
  CHECK(failed_with(m) == Rules{"motors_off_at_start", "motors_follow_enable", "release"});
}

TEST_CASE("conform names a device clock of another unit, and one that runs backwards", "[conform]") {
  CHECK(failed_with(in_reports([](ReportBytes& r) {
          put_i32(r, 4, static_cast<std::int32_t>(static_cast<std::uint32_t>(i32(r, 4)) / 1000U));
        })).count("device_time") == 1);
  CHECK(failed_with(in_reports([](ReportBytes& r) { put_i32(r, 4, -i32(r, 4)); })).count("device_time") == 1);
}

TEST_CASE("conform names a report rate that differs from the profile", "[conform]") {
  DeviceProfile slow = reference_profile();
  slow.report_rate_Hz = 800.0;
  Run run({}, slow);
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail) == Rules{"report_rate"});
}

TEST_CASE("conform judges report descriptor, id and serial number of a USB device", "[conform]") {
  UsbDevice good;
  good.report_descriptor.assign(std::begin(wf_report_descriptor), std::end(wf_report_descriptor));
  good.vendor = 0x1d50, good.product = 0x1234;
  good.serial = "A1";
  good.usage_page = 0xff00, good.usage = 0x01;
  UsbDevice shorter = good, broken = good, mouse = good, shared = good, nameless = good;
  shorter.report_descriptor[20] = 0x3E;  // report count 62
  broken.report_descriptor.pop_back();
  mouse.usage_page = 0x01, mouse.usage = 0x02;
  shared.vendor = 0x16c0, shared.product = 0x0486;  // every Teensy
  nameless.serial.clear();
  const std::vector<std::pair<UsbDevice, Rules>> cases = {
      {good, {}},
      {shorter, {"report_descriptor"}},
      {broken, {"report_descriptor"}},
      {mouse, {"report_descriptor"}},
      {shared, {"usb_id"}},
      {nameless, {"serial_number"}},
  };
  for (const auto& [usb, expected] : cases) {
    Run run;
    run.usb = &usb;
    run.check({0s, false});
    INFO(conformance_text(run.results));
    CHECK(run.with(Judgement::fail) == expected);
    CHECK(run.of("serial_number").judgement != Judgement::not_judged);
  }
}

TEST_CASE("conform does not judge what it did not see", "[conform]") {
  SimulationSettings still;
  still.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0, 0, 0}}};
  Run run({}, reference_profile(), still);
  run.check({1s, false});
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail).empty());
  for (const char* rule :
       {"quaternion_order", "linear_velocity", "angular_velocity", "force_direction", "torque_direction"})
    CHECK(run.of(rule).judgement == Judgement::not_judged);
  CHECK(run.device.max_force_N() == 0.0);
}

TEST_CASE("conform does not judge the direction of a device in a clamp", "[conform]") {
  SimulationSettings clamped = hand();
  clamped.coulomb_friction_N = 3.0;
  clamped.coulomb_friction_Nm = 0.1;
  Run run({}, reference_profile(), clamped);
  run.check();
  INFO(conformance_text(run.results));
  CHECK(run.with(Judgement::fail).empty());
  CHECK(run.of("force_direction").judgement == Judgement::not_judged);
}

TEST_CASE("a cancelled check releases the device at once, whenever it is cancelled", "[conform]") {
  int during_force = 0;
  for (Duration when = 500ms; when < 9s; when += 137ms) {
    Run run;
    run.cancelled = [&run, when] { return run.clock.now() >= TimePoint{} + when; };
    bool ended = true;
    try {
      run.check();
    } catch (const SessionCancelled&) {
      ended = false;
    }
    during_force += !ended && run.device.max_force_N() > 0.0 ? 1 : 0;
    run.settle();
    CHECK_FALSE(run.device.firmware().motors_on);
    CHECK(run.device.motor_wrench().force_N.norm() == 0.0);
    if (ended) break;
  }
  CHECK(during_force > 0);
}

TEST_CASE("a device that is unplugged or falls silent ends the check with a reason", "[conform]") {
  Run run;
  run.device.inject({SimulatedFault::Kind::unplug, 2s, 1s});
  CHECK_THROWS_WITH(run.check(), Contains("disconnected"));
  Run silent;
  silent.device.inject({SimulatedFault::Kind::silence, 3500ms, std::chrono::hours(1)});
  CHECK_THROWS_WITH(silent.check(), Contains("stopped sending"));
  silent.settle();
  CHECK_FALSE(silent.device.firmware().motors_on);
}

TEST_CASE("conform accepts profiles of the open report layout only", "[conform]") {
  const SearchPath shipped({test::source_path("config")});
  for (const char* name : {"loopback", "reference_full_speed", "reference_high_speed"})
    CHECK_NOTHROW(require_open_layout(load_profile_named(name, shipped)));
  for (const char* name : {"example", "polhem", "falcon", "spacemouse_split", "woodenhaptics"})
    CHECK_THROWS_WITH(require_open_layout(load_profile_named(name, shipped)), Contains("open report layout"));
  DeviceProfile without_velocity = reference_profile();
  without_velocity.pose_report.linear_velocity = without_velocity.pose_report.angular_velocity = {};
  CHECK_NOTHROW(require_open_layout(without_velocity));
  DeviceProfile moved = reference_profile();
  moved.pose_report.position.byte = 9;
  CHECK_THROWS(require_open_layout(moved));
}

// --- the program ------------------------------------------------------------------------------------------

TEST_CASE("wrenchctl conform judges a device at the other end of a socket, and its exit code tells",
          "[conform][wall_time]") {
  FirmwareMistakes inverted = in_motors([](wf_wrench& w) {
    for (std::int32_t& f : w.force_uN) f = -f;
  });
  const MachineLoad load;
  for (const bool good : {true, false}) {
    const FirmwareProcess device(hand(), good ? FirmwareMistakes{} : inverted);
    const ProgramResult result =
        run_program("wrenchctl", {"conform", test::source_path("config/profiles/reference_full_speed.toml"),
                                  "--link-fd", device.socket(), "--motion", "5"});
    INFO(result.out << result.err);
    REQUIRE_RATE(load, result.exit_code == (good ? 0 : 5));
    CHECK_THAT(result.out, Contains("rules passed"));
    if (!good) {
      CHECK_THAT(result.out, Contains("FAIL        force_direction"));
      CHECK_THAT(result.out, Contains("(breaks devices/README.md, Frames, units and signs)"));
    }
  }
}

TEST_CASE("a signal ends wrenchctl conform, which releases the device", "[conform][wall_time]") {
  const MachineLoad load;
  const FirmwareProcess device(hand());
  RunningProgram program(
      "wrenchctl", {"conform", test::source_path("config/profiles/reference_full_speed.toml"), "--link-fd",
                    device.socket(), "--motion", "3"});
  REQUIRE_RATE(load, program.wait_for_output("Pulses of at most"));
  for (int i = 0; i < 100 && !device.motors_on(); ++i) std::this_thread::sleep_for(1ms);
  REQUIRE_RATE(load, device.motors_on());
  program.signal(SIGTERM);
  const ProgramResult result = program.wait();
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Contains("cancelled; the device was released"));
  for (int i = 0; i < 100 && device.motors_on(); ++i) std::this_thread::sleep_for(10ms);
  CHECK_FALSE(device.motors_on());
  REQUIRE_RATE(load, !device.tripped());  // released by the commands, not by the watchdog
}

TEST_CASE("wrenchctl conform rejects what it cannot check, with the remedy", "[conform]") {
  const ProgramResult unnamed = run_program("wrenchctl", {"conform", "--link-fd", "3"});
  CHECK(unnamed.exit_code == 1);
  CHECK_THAT(unnamed.err, Contains("--link-fd") && Contains("name its profile"));
  const ProgramResult other = run_program(
      "wrenchctl", {"conform", test::source_path("config/profiles/polhem.toml"), "--link-fd", "3"});
  CHECK(other.exit_code == 1);
  CHECK_THAT(other.err, Contains("open report layout"));
  const ProgramResult node = run_program("wrenchctl", {"conform", "--node", "/dev/null"});
  CHECK(node.exit_code == 1);
  CHECK_THAT(node.err, Contains("/dev/null"));
}

}  // namespace wrenchd::test_conformance
