// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/reference_layout.hpp"
#include "devices/report_codec.hpp"

using namespace wrenchd;

namespace {

void check_same(const ReportField& a, const ReportField& b) {
  CHECK(a.present == b.present);
  if (!a.present) return;
  CHECK(a.byte == b.byte);
  CHECK(a.bits == b.bits);
  CHECK(a.is_signed == b.is_signed);
  CHECK(a.step == b.step);
  CHECK(a.count == b.count);
}

void check_same(const ReportBit& a, const ReportBit& b) {
  CHECK(a.present == b.present);
  CHECK(a.byte == b.byte);
  CHECK(a.bit == b.bit);
}

}  // namespace

TEST_CASE("the shipped loopback profile is the reference report layout", "[profiles]") {
  const DeviceProfile file = load_profile(WRENCHD_SOURCE_DIR "/config/profiles/loopback.toml");
  const DeviceProfile code = reference_profile();
  const PoseReportLayout& p = file.pose_report;
  const PoseReportLayout& q = code.pose_report;
  CHECK(p.id == q.id);
  CHECK(p.length == q.length);
  CHECK(p.checksum == q.checksum);
  check_same(p.sequence, q.sequence);
  check_same(p.device_time, q.device_time);
  check_same(p.position, q.position);
  check_same(p.orientation, q.orientation);
  check_same(p.linear_velocity, q.linear_velocity);
  check_same(p.angular_velocity, q.angular_velocity);
  check_same(p.acknowledged, q.acknowledged);
  check_same(p.buttons, q.buttons);
  check_same(p.motors_on, q.motors_on);
  check_same(p.watchdog_tripped, q.watchdog_tripped);
  const WrenchReportLayout& w = file.wrench_report;
  const WrenchReportLayout& v = code.wrench_report;
  CHECK(w.id == v.id);
  CHECK(w.length == v.length);
  CHECK(w.checksum == v.checksum);
  check_same(w.sequence, v.sequence);
  check_same(w.force, v.force);
  check_same(w.torque, v.torque);
  check_same(w.hold_time, v.hold_time);
  check_same(w.enable, v.enable);
  CHECK(file.max_force_N == code.max_force_N);
  CHECK(file.max_torque_Nm == code.max_torque_Nm);
  CHECK(file.report_rate_Hz == code.report_rate_Hz);
  CHECK(file.watchdog_s == code.watchdog_s);
}
