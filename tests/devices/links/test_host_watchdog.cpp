// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <chrono>
#include <string>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/links/host_watchdog.hpp"
#include "devices/report_codec.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_host_watchdog {

namespace {

using namespace std::chrono_literals;

constexpr TimePoint kStart = TimePoint{} + 5s;
constexpr Duration kAfter = 6ms;

DeviceProfile shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml");
}

Packet packet_of(const DeviceProfile& profile, const WrenchReport& report) {
  Packet packet;
  packet.length = encode(profile.wrench_report, report, packet.bytes);
  return packet;
}

WrenchReport push(std::uint64_t sequence) {
  WrenchReport report;
  report.F.force_N = {1.0, 0.0, 0.0};
  report.hold_time_s = 0.008;
  report.sequence = sequence;
  report.enable = true;
  return report;
}

/// A watchdog that received a report at kStart.
struct FedWatchdog {
  DeviceProfile profile;
  HostWatchdog watchdog;
  Packet packet;

  FedWatchdog(const DeviceProfile& of, const WrenchReport& report) : profile(of), watchdog(profile, kAfter) {
    watchdog.feed(kStart, packet_of(profile, report));
  }
  bool sends_zero(TimePoint now) { return watchdog.send_zero(now, packet); }
  WrenchReport spoken() const { return decode(profile.wrench_report, packet.report()).report; }
};

TEST_CASE("if the loop hangs after a nonzero wrench, the watchdog sends zero with the motors off",
          "[host_watchdog]") {
  FedWatchdog fed(shipped("loopback"), push(65534));
  CHECK(fed.watchdog.due() == kStart + kAfter);
  CHECK_FALSE(fed.sends_zero(kStart + kAfter - 1ns));
  TimePoint now = kStart + kAfter;
  for (unsigned n = 1; n <= HostWatchdog::kZeroReports; ++n, now += HostWatchdog::kZeroInterval) {
    REQUIRE(fed.watchdog.due() == now);
    REQUIRE(fed.sends_zero(now));
    const WrenchReport report = fed.spoken();
    CHECK(report.F.force_N.isZero(0.0));
    CHECK(report.F.torque_Nm.isZero(0.0));
    CHECK_FALSE(report.enable);
    CHECK(report.hold_time_s == Approx(0.008));
    CHECK(report.sequence == ((65534 + n) & 0xffff));  // a device accepts no sequence twice
    CHECK(decode(fed.profile.wrench_report, fed.packet.report()).outcome == Decoding::ok);
  }
  CHECK(fed.watchdog.due() == TimePoint::max());
  CHECK_FALSE(fed.sends_zero(now + 1h));
}

TEST_CASE("the watchdog does not interrupt a running loop", "[host_watchdog]") {
  FedWatchdog fed(shipped("loopback"), push(1));
  TimePoint now = kStart;
  for (std::uint64_t n = 2; n < 100; ++n) {
    now += 1ms;
    CHECK_FALSE(fed.sends_zero(now));
    fed.watchdog.feed(now, packet_of(fed.profile, push(n)));
  }
  CHECK(fed.sends_zero(now + kAfter));
  // After the loop resumes, the watchdog is armed again.
  fed.watchdog.feed(now + 1s, packet_of(fed.profile, push(7)));
  CHECK_FALSE(fed.sends_zero(now + 1s));
  REQUIRE(fed.sends_zero(now + 1s + kAfter));
  CHECK(fed.spoken().sequence == 8);
}

TEST_CASE("the watchdog ignores silence after a zero wrench", "[host_watchdog]") {
  // The self-test of the device's watchdog: motors on, zero wrench, then silence.
  const DeviceProfile profile = shipped("loopback");
  WrenchReport rest = push(1);
  rest.F = {};
  CHECK(FedWatchdog(profile, rest).watchdog.due() == TimePoint::max());
  WrenchReport off = push(1);
  off.enable = false;
  CHECK(FedWatchdog(profile, off).watchdog.due() == TimePoint::max());
  CHECK(HostWatchdog().due() == TimePoint::max());
  // A device without motors.
  DeviceProfile mouse = shipped("spacemouse_split");
  REQUIRE_FALSE(mouse.has_output);
  CHECK(HostWatchdog(mouse, kAfter).due() == TimePoint::max());
}

TEST_CASE("a report that is no wrench does not change the watchdog's state", "[host_watchdog]") {
  FedWatchdog fed(shipped("loopback"), push(1));
  Packet other;
  other.length = 3;
  other.bytes[0] = 0x7f;
  fed.watchdog.feed(kStart + 5ms, other);
  CHECK(fed.watchdog.due() == kStart + kAfter);
  CHECK(fed.sends_zero(kStart + kAfter));
}

TEST_CASE("the watchdog sends zero efforts to a device with motor efforts", "[host_watchdog]") {
  const DeviceProfile polhem = shipped("polhem");
  REQUIRE(polhem.wrench_report.efforts.present);
  WrenchReport report;
  report.efforts = {0.0, 0.3, 0.0};
  FedWatchdog fed(polhem, report);
  REQUIRE(fed.sends_zero(kStart + kAfter));
  for (const double effort : fed.spoken().efforts) CHECK(effort == 0.0);
  report.efforts = {};
  CHECK(FedWatchdog(polhem, report).watchdog.due() == TimePoint::max());
}

TEST_CASE("the watchdog does not allocate or lock", "[host_watchdog]") {
  FedWatchdog fed(shipped("loopback"), push(1));
  const Packet packet = packet_of(fed.profile, push(2));
  std::uint64_t allocations = 0, locks = 0;
  {
    const test::RealtimeGuard guard;
    fed.watchdog.feed(kStart, packet);
    fed.sends_zero(kStart + kAfter);
    allocations = guard.allocations(), locks = guard.locks();
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace
}  // namespace wrenchd::test_host_watchdog
