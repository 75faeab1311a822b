// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The longest report wrenchd handles: one packet of a full-speed interrupt endpoint.
inline constexpr std::size_t kMaxReportBytes = 64;

/// What a device's reports say, in SI units, before anybody judged it. Counters are raw: they wrap at the
/// width of their field. What no layout carries is zero. D = the device's own base axes, E = the frame whose
/// pose it sends, H = handle point.
struct PoseReport {
  Pose X_BH;                       ///< X_DE; the quaternion exactly as reported, not normalised
  Twist V_BH;                      ///< of the handle point, in axes of D
  std::uint64_t sequence = 0;      ///< [counts]
  std::uint64_t device_time = 0;   ///< [counts], layout.device_time.step seconds each
  std::uint64_t acknowledged = 0;  ///< low bits of the sequence of the last command taken
  std::uint32_t buttons = 0;       ///< bit mask
  bool motors_on = false;
  bool watchdog_tripped = false;
  bool homed = true;  ///< the encoders know where they are; true where the device does not say
  Vector3d translation_m = Vector3d::Zero();  ///< of a cap that springs back, in D
  Vector3d rotation_rad = Vector3d::Zero();   ///< likewise: rotation vector
  std::array<double, kMaxJoints> joints{};    ///< encoder counts, in the order of the report
};

/// A wrench command as it stands in its bytes, in SI units.
struct WrenchReport {
  Wrench F;                    ///< on the hand, about the point and in the axes the profile names
  double hold_time_s = 0.0;    ///< how long the device may hold it; 0: the device's own default
  std::uint64_t sequence = 0;  ///< raw, wraps at the width of its field
  bool enable = false;         ///< motors on
  std::array<double, kMaxMotors> efforts{};  ///< of the motors, where the device takes these instead
};

/// Whether bytes are the report a layout describes, and if not, why.
enum class Decoding : std::uint8_t { ok, wrong_length, wrong_id, bad_checksum, wrong_marker };

/// A report read from bytes; where the outcome is not ok the report holds only defaults.
template <class Report>
struct Decoded {
  Decoding outcome = Decoding::ok;
  Report report;
};

// The four directions. The host decodes poses and encodes wrenches, a firmware does the opposite, and both
// use these functions. All of them need a layout that has passed check(), and all are RT safe.
//
//   value = step * raw + offset        raw: little-endian unless the field says so, two's complement where
//                                      signed
//
// Encoding rounds to the nearest count, ties away from zero, and saturates at the ends of the field. A value
// that is not finite becomes raw 0, never full scale; callers refuse such values long before. What a report
// that is short, but not too short, lacks reads as 0.

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;
Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;

/// Reads what this layout carries into `report`, and leaves the rest of it as it was: a pose may come in
/// pieces. Where the outcome is not ok, nothing changes.
Decoding decode_into(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes,
                     PoseReport& report) noexcept;

/// The raw integer, sign extended into 64 bits where the field has a sign. RT safe.
std::uint64_t raw_integer(const ReportField& field, std::span<const std::uint8_t> bytes,
                          std::size_t index = 0) noexcept;
/// The SI value of an integer. RT safe.
double field_value(const ReportField& field, std::span<const std::uint8_t> bytes,
                   std::size_t index = 0) noexcept;
/// RT safe.
bool bit_value(const ReportBit& bit, std::span<const std::uint8_t> bytes) noexcept;

/// Writes the report to the first `layout.length` bytes of `bytes`. Returns that length, or 0 and writes
/// nothing where `bytes` is too short.
std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept;
std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept;

/// Refuses a layout whose fields overlap, stick out, have no meaning or leave no room for the checksum.
/// Throws std::invalid_argument that names the fields and the byte. Not RT safe.
void check(const PoseReportLayout& layout);
void check(const WrenchReportLayout& layout);
/// The same for all reports of a profile, and refuses a profile whose reports do not make a pose together,
/// cannot be told apart, or whose wrench report does not carry what its limits promise.
void check_reports(const DeviceProfile& profile);

/// CRC-16/CCITT-FALSE: polynomial 0x1021, initial value 0xFFFF, nothing reflected, no final xor.
/// The check value over "123456789" is 0x29B1. RT safe.
std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace wrenchd
