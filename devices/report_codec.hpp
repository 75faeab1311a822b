// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Length of the longest report: one packet of a full-speed interrupt endpoint.
inline constexpr std::size_t kMaxReportBytes = 64;

/// Content of a device's reports in SI units, before validation. Counters are raw and wrap at the width of
/// their field. Fields that no layout carries are zero. D = the device's own frame, E = the frame whose pose
/// it sends, H = handle frame.
struct PoseReport {
  Pose X_BH;                       ///< X_DE; the quaternion as reported, not normalised
  Twist V_BH;                      ///< velocity of E, in D
  std::uint64_t sequence = 0;      ///< [counts]
  std::uint64_t device_time = 0;   ///< [counts] of layout.device_time.step seconds
  std::uint64_t acknowledged = 0;  ///< low bits of the sequence of the last accepted command
  std::uint32_t buttons = 0;       ///< pressed buttons, as a bit mask
  bool motors_on = false;
  bool watchdog_tripped = false;
  bool homed = true;  ///< true if the encoders have found their zero, or the device does not report it
  Vector3d translation_m = Vector3d::Zero();  ///< deflection of a spring-loaded puck, in D
  Vector3d rotation_rad =
      Vector3d::Zero();                     ///< deflection of a spring-loaded puck, as a rotation vector in D
  std::array<double, kMaxJoints> joints{};  ///< encoder counts, in the order of the report
};

/// Content of a wrench command in SI units.
struct WrenchReport {
  Wrench F;                    ///< wrench on the hand, about the point and in the axes that the profile names
  double hold_time_s = 0.0;    ///< time for which the device may apply the command; 0: default of the device
  std::uint64_t sequence = 0;  ///< raw; wraps at the width of its field
  bool enable = false;         ///< true: motors on
  std::array<double, kMaxMotors>
      efforts{};  ///< motor efforts, for devices that accept efforts instead of a wrench
};

/// Result of decoding: whether the bytes match the layout, and if not, why.
enum class Decoding : std::uint8_t { ok, wrong_length, wrong_id, bad_checksum, wrong_marker };

/// A decoded report. If the outcome is not ok, the report has its default values.
template <class Report>
struct Decoded {
  Decoding outcome = Decoding::ok;
  Report report;
};

// Encoding and decoding in both directions. The host decodes poses and encodes wrenches. An emulated firmware
// does the opposite with the same functions. The layout must have passed check(). All functions are RT-safe
// unless stated otherwise.
//
//   value = step * raw + offset        raw: little-endian unless the field states otherwise; two's complement
//                                      if signed
//
// Encoding rounds to the nearest count, ties away from zero, and clamps to the range of the field. A value
// that is not finite becomes raw 0; callers reject such values earlier. Fields beyond the end of a short but
// permitted report decode to 0.

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;
Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;

/// Decodes the fields of this layout into `report` and leaves its other fields unchanged, because a pose may
/// arrive in parts. If the outcome is not ok, changes nothing. RT-safe.
Decoding decode_into(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes,
                     PoseReport& report) noexcept;

/// Returns the raw integer, sign-extended to 64 bits if the field is signed. RT-safe.
std::uint64_t raw_integer(const ReportField& field, std::span<const std::uint8_t> bytes,
                          std::size_t index = 0) noexcept;
/// Returns the SI value of an integer. RT-safe.
double field_value(const ReportField& field, std::span<const std::uint8_t> bytes,
                   std::size_t index = 0) noexcept;
/// Returns the value of a bit. RT-safe.
bool bit_value(const ReportBit& bit, std::span<const std::uint8_t> bytes) noexcept;

/// Writes the report to the first `layout.length` bytes of `bytes` and returns that length. Returns 0 and
/// writes nothing if `bytes` is too short. RT-safe.
std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept;
std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept;

/// Validates a layout. Throws std::invalid_argument with the fields and the byte if fields overlap, exceed
/// the report, are meaningless or leave no room for the checksum. Not RT-safe: allocates.
void check(const PoseReportLayout& layout);
void check(const WrenchReportLayout& layout);
/// Validates all reports of a profile. Throws std::invalid_argument also if the reports together give no
/// pose, cannot be distinguished, or if the wrench report cannot represent the limits. Not RT-safe:
/// allocates.
void check_reports(const DeviceProfile& profile);

/// Returns the CRC-16/CCITT-FALSE: polynomial 0x1021, initial value 0xFFFF, not reflected, no final xor. The
/// check value over "123456789" is 0x29B1. RT-safe.
std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace wrenchd
