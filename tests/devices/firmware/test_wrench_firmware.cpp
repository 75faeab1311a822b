// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/runtime.hpp"
#include "devices/layout_check.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/profile_reports.hpp"
#include "devices/report_codec.hpp"
#include "devices/report_descriptor.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "tests/support/firmware_in_hand.hpp"
#include "tests/support/hex_text.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_wrench_firmware {

// The firmware reference of devices/firmware/: its core alone against the rules of devices/README.md, and as
// the far side of a link of the driver and of the servo loop.

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

constexpr std::uint32_t kNow_us = 0xFFFFF000U;  // the clock wraps during the test cases

const DeviceProfile& layout() {
  static const DeviceProfile profile = reference_profile();
  return profile;
}

/// The core with its two contexts at times that the test chooses.
struct Core {
  explicit Core(wf_limits limits = {10'000'000, 500'000, 8}) { wf_init(&firmware, &limits); }

  bool take(const CommandBytes& bytes) {
    return wf_take_command(&firmware, now_us, bytes.data(), bytes.size());
  }
  bool take(const WrenchReport& report) {
    CommandBytes bytes(WF_WRENCH_REPORT_BYTES);
    encode(layout().wrench_report, report, bytes);
    return take(bytes);
  }
  bool take(std::uint64_t sequence, bool enable = true, double hold_s = 0.008) {
    WrenchReport report;
    report.F.force_N = {1.0, -2.0, 3.0};
    report.sequence = sequence;
    report.enable = enable;
    report.hold_time_s = hold_s;
    return take(report);
  }
  /// Runs the motor context once, after a pause.
  bool run(std::uint32_t pause_us = 0) {
    now_us += pause_us;
    return wf_motor_wrench(&firmware, now_us, &wrench);
  }
  PoseReport report() {
    ReportBytes bytes(WF_POSE_REPORT_BYTES);
    const wf_sample sample{};
    wf_make_report(&firmware, &sample, bytes.data());
    const auto decoded = decode(layout().pose_report, bytes);
    REQUIRE(decoded.outcome == Decoding::ok);
    return decoded.report;
  }

  wf_firmware firmware{};
  wf_wrench wrench{};
  std::uint32_t now_us = kNow_us;
};

Vector3d force_N(const wf_wrench& w) {
  return 1e-6 * Vector3d(w.force_uN[0], w.force_uN[1], w.force_uN[2]);
}
Vector3d torque_Nm(const wf_wrench& w) {
  return 1e-6 * Vector3d(w.torque_uNm[0], w.torque_uNm[1], w.torque_uNm[2]);
}

CommandBytes sealed(WrenchReport report) {
  CommandBytes bytes(WF_WRENCH_REPORT_BYTES);
  encode(layout().wrench_report, report, bytes);
  return bytes;
}

}  // namespace

TEST_CASE("the firmware computes the CRC of the page", "[firmware]") {
  const std::string digits = "123456789";
  CHECK(wf_crc16(reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size()) == 0x29B1);
}

TEST_CASE("the firmware makes and accepts the example reports of the page, byte for byte", "[firmware]") {
  Core core;
  const CommandBytes command = {0x02, 0x01, 0xc8, 0x00, 0x40, 0x42, 0x0f, 0x00, 0x60, 0xda, 0xd9,
                                0xff, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x50, 0xc3,
                                0x00, 0x00, 0x60, 0x79, 0xfe, 0xff, 0x08, 0x00, 0x74, 0x3b};
  REQUIRE(core.take(command));
  REQUIRE(core.run());
  CHECK(force_N(core.wrench).isApprox(Vector3d(1.0, -2.5, 0.0)));
  CHECK(torque_Nm(core.wrench).isApprox(Vector3d(0.0, 0.05, -0.1)));

  wf_sample sample{};
  sample.device_time_us = 1'000'000;
  const std::array<std::int32_t, 3> p = {1'000'000, -500'000, 2'000'000};
  const std::array<std::int32_t, 4> q = {0, 0, 0x2d413ccd, 0x2d413ccd};
  const std::array<std::int32_t, 3> v = {250'000, 0, -500'000}, w = {0, 0, 1'500'000};
  std::copy(p.begin(), p.end(), sample.position);
  std::copy(q.begin(), q.end(), sample.orientation);
  std::copy(v.begin(), v.end(), sample.linear_velocity);
  std::copy(w.begin(), w.end(), sample.angular_velocity);
  sample.buttons = 1;
  core.firmware.report_sequence = 512;
  ReportBytes report(WF_POSE_REPORT_BYTES, 0xAA);
  wf_make_report(&core.firmware, &sample, report.data());
  CHECK(hex_text(report) ==
        "0101010240420F0040420F00E05EF8FF80841E000000000000000000CD3C412D"
        "CD3C412D90D0030000000000E05EF8FF000000000000000060E3160001C8E54F");
}

TEST_CASE("the firmware's report descriptor is that of the page and agrees with the profile", "[firmware]") {
  CHECK(hex_text(wf_report_descriptor) == "0600FF0901A101150026FF00750885010902953F810285020903951F9102C0");
  const ReportDescriptor descriptor = parse_report_descriptor(wf_report_descriptor);
  CHECK(find_differences(descriptor, expected_reports(layout())).empty());
}

TEST_CASE("the firmware reads every command as the codec wrote it", "[firmware]") {
  Core core({0xFFFFFFFFU, 0xFFFFFFFFU, 8});
  std::mt19937_64 random(23);
  std::uniform_real_distribution<double> any(-2147.0, 2147.0);
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    WrenchReport report;
    report.sequence = i & 0xFFFFU;
    report.enable = i % 3 != 0;
    report.F = {{any(random), any(random), any(random)}, {any(random), any(random), any(random)}};
    REQUIRE(core.take(report));
    CHECK(core.run() == report.enable);
    if (!report.enable) report.F = {};
    CHECK((force_N(core.wrench) - report.F.force_N).norm() < 1e-6);
    CHECK((torque_Nm(core.wrench) - report.F.torque_Nm).norm() < 1e-6);
    CHECK(core.report().acknowledged == (i & 0xFFU));
  }
}

TEST_CASE("rule 2: the sequence of the reports rises by one and wraps", "[firmware]") {
  Core core;
  core.firmware.report_sequence = 0xFFFE;
  CHECK(core.report().sequence == 0xFFFF);
  CHECK(core.report().sequence == 0);
  CHECK(core.report().sequence == 1);
}

TEST_CASE("rule 5: the firmware accepts what is valid and in order", "[firmware]") {
  Core core;
  CHECK(core.take(65530));  // the first command may have any sequence
  core.run();
  CHECK_FALSE(core.take(65530));           // never the same
  CHECK_FALSE(core.take(65529));           // behind, motors on
  CHECK_FALSE(core.take(65530U - 32768));  // 32768 ahead counts as behind
  CHECK(core.take(65531));
  CHECK(core.take((65531U + 32767) & 0xFFFFU));  // as far ahead as possible
  core.run();
  CHECK(core.take(32763, false));
  core.run();
  CHECK_FALSE(core.take(32763, true));
  CHECK(core.take(5));  // the motors are off: a restarted host
}

TEST_CASE("rule 5: an accepted command counts before the motor context has seen it", "[firmware]") {
  Core core;
  CHECK(core.take(100, true));
  CHECK_FALSE(core.take(99));  // the motors are about to switch on
  CHECK(core.take(101, false));
  CHECK(core.take(50, false));  // the motors are about to switch off
}

TEST_CASE("rule 5: a rejected command has no effect and does not feed the watchdog", "[firmware]") {
  WrenchReport off;
  off.sequence = 11;
  const CommandBytes good = sealed(off);
  std::vector<CommandBytes> bad(6, good);
  bad[0][31] ^= 1;      // checksum
  bad[1][4] ^= 1;       // content
  bad[2].pop_back();    // length
  bad[3].push_back(0);  // length
  bad[4][0] = 0x03;     // id
  bad[5] = {};          // nothing
  seal(bad[4]);
  Core core;
  REQUIRE(core.take(10));
  REQUIRE(core.run(1000));
  for (const CommandBytes& bytes : bad) {
    CHECK_FALSE(core.take(bytes));
    CHECK(core.run(100));
    CHECK(core.report().acknowledged == 10);
    CHECK(force_N(core.wrench).norm() > 3.0);
  }
  CHECK_FALSE(core.run(7000));  // 8 ms after the accepted command
}

TEST_CASE("rule 6: the watchdog applies a command for its hold time, at most 32 ms", "[firmware]") {
  struct Case {
    double hold_s;
    std::uint32_t limit_us;
  };
  for (const auto& [hold_s, limit_us] : {Case{0.001, 1000}, Case{0.008, 8000}, Case{0.032, 32000},
                                         Case{0.033, 32000}, Case{65.535, 32000}, Case{0.0, 8000}}) {
    INFO("hold time " << hold_s);
    Core core;
    REQUIRE(core.take(1, true, hold_s));
    CHECK(core.run(limit_us));
    CHECK(core.report().motors_on);
    CHECK_FALSE(core.report().watchdog_tripped);
    CHECK_FALSE(core.run(1));
    CHECK(force_N(core.wrench).norm() == 0.0);
    CHECK_FALSE(core.report().motors_on);
    CHECK(core.report().watchdog_tripped);
    // The bit stays until a command with `enable`.
    CHECK(core.take(2, false));
    core.run();
    CHECK(core.report().watchdog_tripped);
    CHECK(core.take(3, true));
    CHECK(core.run());
    CHECK_FALSE(core.report().watchdog_tripped);
  }
}

TEST_CASE("rule 6: a default hold time outside 1 to 32 ms is replaced by 32 ms", "[firmware]") {
  for (const std::uint16_t wrong : {std::uint16_t{0}, std::uint16_t{33}, std::uint16_t{65535}}) {
    Core core({10'000'000, 500'000, wrong});
    REQUIRE(core.take(1, true, 0.0));
    CHECK(core.run(32000));
    CHECK_FALSE(core.run(1));
  }
}

TEST_CASE("rule 6: a command that expired before the motor context saw it trips the watchdog", "[firmware]") {
  Core core;
  REQUIRE(core.take(1));
  CHECK_FALSE(core.run(8001));
  CHECK(core.report().watchdog_tripped);
  CHECK_FALSE(core.run(0xFFFFFFFFU - 8000));  // a whole period of the clock later
}

TEST_CASE("rule 7: motors are off at power-on, at enable 0 and while USB is suspended, without a trip",
          "[firmware]") {
  Core core;
  CHECK_FALSE(core.run(1'000'000));
  CHECK_FALSE(core.report().motors_on);
  REQUIRE(core.take(1));
  REQUIRE(core.run());
  REQUIRE(core.take(2, false));
  CHECK_FALSE(core.run());
  CHECK(force_N(core.wrench).norm() == 0.0);
  CHECK_FALSE(core.run(1'000'000));
  CHECK_FALSE(core.report().watchdog_tripped);
  REQUIRE(core.take(3));
  REQUIRE(core.run());
  wf_disable(&core.firmware, core.now_us);
  CHECK_FALSE(core.run());
  CHECK_FALSE(core.report().watchdog_tripped);
  CHECK(core.report().acknowledged == 3);
  CHECK_FALSE(core.take(3));  // the repeated command stays invalid
  CHECK(core.take(4));
  CHECK(core.run());
}

TEST_CASE("rule 8: saturation keeps the direction of any force and torque", "[firmware]") {
  Core core({5'000'000, 200'000, 8});
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> any(-2147.48, 2147.48);
  const Vector3d corner = Vector3d::Constant(-2147.483648);
  std::uint64_t sequence = 0;
  for (int i = 0; i < 1000; ++i) {
    WrenchReport report;
    report.sequence = ++sequence;
    report.enable = true;
    report.F = {i == 0 ? corner : Vector3d(any(random), any(random), any(random)),
                i == 0 ? corner : Vector3d(any(random), any(random), any(random)) * 1e-3};
    REQUIRE(core.take(report));
    REQUIRE(core.run());
    const auto check = [](const Vector3d& applied, const Vector3d& demanded, double limit) {
      CHECK(applied.norm() <= limit);
      const Vector3d expected = demanded * std::min(1.0, limit / demanded.norm());
      CHECK((applied - expected).norm() < 3e-6);
    };
    check(force_N(core.wrench), report.F.force_N, 5.0);
    check(torque_Nm(core.wrench), report.F.torque_Nm, 0.2);
  }
}

TEST_CASE("the firmware decides as the simulated firmware for random commands", "[firmware]") {
  const DeviceProfile profile = reference_profile();
  std::mt19937_64 random(5);
  const auto below = [&random](std::uint64_t n) { return random() % n; };
  int accepted = 0, tripped = 0;
  for (int run = 0; run < 50; ++run) {
    Core core;
    SimulatedFirmware simulated(profile, {}, 125us);
    const TimePoint start{};
    std::uint64_t sequence = below(65536);
    std::uint32_t elapsed_us = 0;
    for (int i = 0; i < 200; ++i) {
      const std::uint32_t pause_us = static_cast<std::uint32_t>(below(20) == 0 ? below(40'000) : below(2000));
      elapsed_us += pause_us;
      const TimePoint now = start + std::chrono::microseconds(elapsed_us);
      core.run(pause_us);
      Wrench F = simulated.motor_wrench(now);
      REQUIRE((force_N(core.wrench) - F.force_N).norm() < 1e-9);

      WrenchReport report;
      const std::uint64_t kind = below(8);
      sequence = kind == 0 ? sequence : kind == 1 ? below(65536) : kind == 2 ? sequence - 1 : sequence + 1;
      report.sequence = sequence & 0xFFFFU;
      report.enable = below(5) != 0;
      report.hold_time_s = 1e-3 * static_cast<double>(below(50));
      report.F.force_N = {1e-3 * static_cast<double>(below(1000)), 0.5, 0.0};
      CommandBytes bytes = sealed(report);
      if (below(10) == 0) bytes[below(bytes.size())] ^= 0x20;
      const bool taken = core.take(bytes);
      REQUIRE(taken == simulated.take_command(now, bytes));
      accepted += taken ? 1 : 0;
      core.run();
      F = simulated.motor_wrench(now);
      REQUIRE((force_N(core.wrench) - F.force_N).norm() < 1e-9);
      const PoseReport a = core.report(), b = simulated.make_report(0s);
      REQUIRE(a.motors_on == b.motors_on);
      REQUIRE(a.watchdog_tripped == b.watchdog_tripped);
      REQUIRE(a.acknowledged == (b.acknowledged & 0xFFU));
      tripped += a.watchdog_tripped ? 1 : 0;
    }
  }
  CHECK(accepted > 1000);
  CHECK(tripped > 100);
}

TEST_CASE("rule 4: the firmware's velocity follows constant motion in all axes", "[firmware]") {
  const Vector3d v(0.12, -0.34, 0.05), w(0.9, -2.0, 1.1);
  for (const std::uint32_t period_us : {125U, 1000U, 10'000U}) {
    INFO("period " << period_us << " us");
    wf_velocity velocity{};
    wf_velocity_init(&velocity, period_us, 128);
    wf_sample sample{};
    for (int i = 0; i < 40; ++i) {
      const double t_s = 1e-6 * period_us * i;
      const Vector3d p = v * t_s;
      Quaterniond q(Eigen::AngleAxisd(w.norm() * t_s, w.normalized()));
      if (i % 2 == 1) q.coeffs() = -q.coeffs();  // the same orientation
      for (int k = 0; k < 3; ++k) sample.position[k] = static_cast<std::int32_t>(std::lround(p[k] * 1e7));
      for (int k = 0; k < 4; ++k)
        sample.orientation[k] = static_cast<std::int32_t>(std::lround(q.coeffs()[k] * 0x1p30));
      wf_velocity_update(&velocity, &sample);
      if (i == 0) CHECK(sample.linear_velocity[0] == 0);
    }
    for (int k = 0; k < 3; ++k) {
      CHECK(1e-6 * sample.linear_velocity[k] == Approx(v[k]).epsilon(0.005).margin(1e-3));
      CHECK(1e-6 * sample.angular_velocity[k] == Approx(w[k]).epsilon(0.005));
    }
  }
}

TEST_CASE("the firmware's velocity survives any jump of the encoders", "[firmware]") {
  wf_velocity velocity{};
  wf_velocity_init(&velocity, 0, 1000);  // clamped to 10 us and 256
  wf_sample sample{};
  sample.orientation[3] = 1 << 30;
  for (int i = 0; i < 100; ++i) {
    for (std::int32_t& x : sample.position) x = i % 2 == 0 ? INT32_MAX : INT32_MIN;
    sample.orientation[i % 2 == 0 ? 0 : 1] = 1 << 30;
    sample.orientation[i % 2 == 0 ? 1 : 0] = sample.orientation[2] = sample.orientation[3] = 0;
    wf_velocity_update(&velocity, &sample);
    if (i > 0) CHECK(sample.linear_velocity[0] == (i % 2 == 0 ? INT32_MAX : -INT32_MAX));
  }
}

// --- the far side of a link -------------------------------------------------------------------------------

namespace {

/// The hand holds the tool above the table, then presses it on the table.
RunConfig pressing() {
  RunConfig plan = shipped_config();
  plan.settings.servo.self_test_s = 0.5;
  plan.settings.limits.soft_start_s = 0.05;
  plan.settings.simulation.hand_path = {
      {0.0, {0, 0, 0.06}, {0, 0, 0}}, {0.9, {0, 0, 0.06}, {0, 0, 0}}, {1.2, {0, 0, 0.018}, {0, 0, 0}}};
  plan.settings.simulation.hand_repeats = false;
  return plan;
}

/// The servo loop, the driver and the firmware core in virtual time.
struct FirmwareRun {
  explicit FirmwareRun(RunConfig plan = pressing(), FirmwareMistakes mistakes = {})
      : device(plan.profile, plan.settings.simulation, std::move(mistakes)),
        link(device, clock, plan.settings.simulation),
        runtime(std::move(plan), link, clock, ProxySearchMode::in_tick) {
    runtime.open();
  }
  void tick() {
    clock.sleep_until(clock.now() + 1ms);
    runtime.loop().tick(clock.now(), clock.now());
    runtime.loop().telemetry().latest_record().read(last);
    seen |= last.faults;
  }
  bool tick_until(State state, int most) {
    for (int i = 0; i < most && this->state() != state; ++i) tick();
    return this->state() == state;
  }
  State state() const { return static_cast<State>(last.state); }

  VirtualClock clock;
  FirmwareInHand device;
  LoopbackLink link;
  Runtime runtime;
  TickRecord last;
  FaultSet seen = 0;
};

}  // namespace

TEST_CASE("wrenchd accepts the firmware: self-test, arm, force in contact, release", "[firmware]") {
  FirmwareRun run;
  REQUIRE(run.tick_until(State::disarmed, 1000));
  run.runtime.loop().requests().arm();
  REQUIRE(run.tick_until(State::active, 300));
  for (int i = 0; i < 1500; ++i) run.tick();
  CHECK(run.seen == 0);
  CHECK(run.state() == State::active);
  CHECK(run.device.motor_wrench().force_N.z() > 1.0);  // the table pushes the hand up
  const Vector3d commanded(run.last.F_out[0], run.last.F_out[1], run.last.F_out[2]);
  CHECK((run.device.motor_wrench().force_N - commanded).norm() < 0.1);
  run.runtime.loop().requests().disarm();
  REQUIRE(run.tick_until(State::disarmed, 500));
  for (int i = 0; i < 5; ++i) run.tick();
  CHECK(run.device.motor_wrench().force_N.norm() == 0.0);
  CHECK_FALSE(run.device.firmware().motors_on);
}

TEST_CASE("if wrenchd stops, the firmware's watchdog ends the force within the hold time", "[firmware]") {
  FirmwareRun run;
  REQUIRE(run.tick_until(State::disarmed, 1000));
  run.runtime.loop().requests().arm();
  REQUIRE(run.tick_until(State::active, 300));
  for (int i = 0; i < 1500; ++i) run.tick();
  REQUIRE(run.device.motor_wrench().force_N.norm() > 1.0);
  const TimePoint last_command = run.clock.now() + 200us;  // the delay of the link
  const Duration hold = from_seconds(run.runtime.config().profile.watchdog_s);
  run.link.advance_to(last_command + hold - 100us);
  CHECK(run.device.motor_wrench().force_N.norm() > 1.0);
  run.link.advance_to(last_command + hold + 200us);
  CHECK(run.device.motor_wrench().force_N.norm() == 0.0);
  CHECK(run.device.firmware().watchdog_tripped);
}

TEST_CASE("wrenchd does not arm if the firmware's watchdog never trips", "[firmware]") {
  FirmwareMistakes frozen;
  std::uint32_t first = 0;
  frozen.motor_clock = [&first](std::uint32_t now_us) {
    if (first == 0) first = now_us;
    return first;  // a clock that stands still: no command becomes old
  };
  frozen.command = {};
  FirmwareRun run(pressing(), frozen);
  CHECK_FALSE(run.tick_until(State::disarmed, 2000));
}

}  // namespace wrenchd::test_wrench_firmware
