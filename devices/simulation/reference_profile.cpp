// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/reference_profile.hpp"

namespace wrenchd {
namespace {

ReportField counter(std::size_t byte, unsigned bits, double step = 1.0) {
  return {.present = true, .byte = byte, .bits = bits, .is_signed = false, .step = step, .count = 1};
}

ReportField integers(std::size_t byte, double step, std::size_t count) {
  return {.present = true, .byte = byte, .bits = 32, .is_signed = true, .step = step, .count = count};
}

ReportBit flag(std::size_t byte, unsigned bit) {
  return {.present = true, .byte = byte, .bit = bit};
}

PoseReportLayout pose_report() {
  PoseReportLayout in;
  in.id = 0x01;
  in.length = 64;
  in.checksum = Checksum::crc16_ccitt_false;
  in.motors_on = flag(1, 0);
  in.watchdog_tripped = flag(1, 1);
  in.sequence = counter(2, 16);
  in.device_time = counter(4, 32, 1e-6);
  in.position = integers(8, 1e-7, 3);
  in.orientation = integers(20, 0x1p-30, 4);
  in.linear_velocity = integers(36, 1e-6, 3);
  in.angular_velocity = integers(48, 1e-6, 3);
  in.buttons = counter(60, 8);
  in.acknowledged = counter(61, 8);
  return in;
}

WrenchReportLayout wrench_report() {
  WrenchReportLayout out;
  out.id = 0x02;
  out.length = 32;
  out.checksum = Checksum::crc16_ccitt_false;
  out.enable = flag(1, 0);
  out.sequence = counter(2, 16);
  out.force = integers(4, 1e-6, 3);
  out.torque = integers(16, 1e-6, 3);
  out.hold_time = counter(28, 16, 1e-3);
  return out;
}

}  // namespace

DeviceProfile reference_profile() {
  DeviceProfile profile;
  profile.name = "loopback";
  profile.description = "Simulated 6-DOF device with the wrenchd reference report layout, version 1";
  profile.transport = Transport::loopback;
  profile.report_rate_Hz = 1000.0;
  profile.max_force_N = 10.0;
  profile.max_torque_Nm = 0.5;
  profile.max_linear_speed_m_per_s = 1.2;
  profile.max_angular_speed_rad_per_s = 12.0;
  profile.watchdog_s = 0.008;
  profile.stale_fault_s = 0.020;
  profile.wrench_point = WrenchPoint::handle;
  profile.pose_report = pose_report();
  profile.wrench_report = wrench_report();
  return profile;
}

}  // namespace wrenchd
