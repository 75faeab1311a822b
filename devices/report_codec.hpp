// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "devices/report_frame.hpp"

namespace wrenchd {

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
  /// Motor efforts, for devices that accept efforts instead of a wrench.
  std::array<double, kMaxMotors> efforts{};
};

/// A decoded report. If the outcome is not ok, the report has its default values.
template <class Report>
struct Decoded {
  Decoding outcome = Decoding::ok;
  Report report;
};

// Encoding and decoding in both directions. The host decodes poses and encodes wrenches. An emulated firmware
// does the opposite with the same functions. The layout must be valid (devices/layout_validation.hpp).
// report_bits.hpp defines rounding and clamping of values. Callers reject values that are not finite before
// they encode them; the codec writes raw 0. Fields beyond the end of a short but permitted report decode to
// 0. All functions are RT-safe.

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;
Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept;

/// Decodes the fields of this layout into `report` and leaves its other fields unchanged, because a pose may
/// arrive in parts. If the outcome is not ok, changes nothing. RT-safe.
Decoding decode_into(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes,
                     PoseReport& report) noexcept;

/// Writes the report to the first `layout.length` bytes of `bytes` and returns that length. Returns 0 and
/// writes nothing if `bytes` is too short. RT-safe.
std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept;
std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept;

}  // namespace wrenchd
