// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "core/pose.hpp"

namespace wrenchd {

/// One integer in a report, as a profile gives it: where it lies, how it is coded, what one count means.
///
///   value_SI = step * raw
struct ReportField {
  bool present = false;
  std::size_t byte = 0;  ///< offset from the start of the report; byte 0 is the report id
  unsigned bits = 0;     ///< width: 8, 16, 32 (whole bytes, little-endian)
  bool is_signed = false;
  double step = 1.0;      ///< SI value of one count
  std::size_t count = 1;  ///< how many equal integers follow each other
};

/// One bit of a report.
struct ReportBit {
  bool present = false;
  std::size_t byte = 0;
  unsigned bit = 0;  ///< 0 = least significant
};

/// Check value at the end of a report.
enum class Checksum : std::uint8_t { none, crc16_ccitt_false };

/// Device to host: one pose sample. Frames: B = device base, H = handle point.
struct PoseReportLayout {
  std::uint8_t id = 0;
  std::size_t length = 0;        ///< bytes, report id included
  ReportField sequence;          ///< counts reports, wraps at its width
  ReportField device_time;       ///< [s], wraps at its width
  ReportField position;          ///< p_BH [m], x y z
  ReportField orientation;       ///< R_BH unit quaternion, x y z w
  ReportField linear_velocity;   ///< of the handle point, in B [m/s]; optional
  ReportField angular_velocity;  ///< in B [rad/s]; optional
  ReportField acknowledged;      ///< sequence of the last command the device took; optional
  ReportBit motors_on;
  ReportBit watchdog_tripped;
  ReportField buttons;                 ///< bit mask; optional
  Checksum checksum = Checksum::none;  ///< over all bytes before it, stored little-endian in the last bytes
};

/// Host to device: one wrench command.
struct WrenchReportLayout {
  std::uint8_t id = 0;
  std::size_t length = 0;
  ReportField sequence;
  ReportField force;      ///< on the hand, at the handle point, in B [N]
  ReportField torque;     ///< on the hand, about the handle point, in B [N.m]
  ReportField hold_time;  ///< [s] how long the device may hold this command before its watchdog trips
  ReportBit enable;       ///< motors on
  Checksum checksum = Checksum::none;
};

/// Where the wrench a device receives is taken about, and in which axes.
enum class WrenchPoint : std::uint8_t {
  handle,        ///< about the device's handle point, in the axes of its base: what a device's motors need
  world_origin,  ///< the paper's spatial wrench W_S (section 2.4), about the world origin in world axes
};

/// Everything wrenchd knows of a device model. One TOML file each (config/profiles/example.toml is the
/// manual). Limits have no default: NaN means "not stated", and a profile that leaves one out does not load.
struct DeviceProfile {
  static constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

  std::string name;
  std::string description;
  std::string transport;               ///< "loopback"; USB HID transports come with their own issue
  double report_rate_Hz = kNotStated;  ///< at which the device sends poses

  // Limits [mandatory]. No client and no daemon setting can raise them.
  double max_force_N = kNotStated;
  double max_torque_Nm = kNotStated;
  double max_linear_speed_m_per_s = kNotStated;
  double max_angular_speed_rad_per_s = kNotStated;

  double watchdog_s = kNotStated;  ///< firmware zeroes its motors this long after the last command
  double stale_fault_s = 0.020;    ///< no new sample for this long: fault
  WrenchPoint wrench_point = WrenchPoint::handle;

  PoseReportLayout pose_report;
  WrenchReportLayout wrench_report;
};

}  // namespace wrenchd
