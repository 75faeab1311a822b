// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include <boost/crc.hpp>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

using Bytes = std::span<const std::uint8_t>;
using MutableBytes = std::span<std::uint8_t>;

constexpr std::size_t kChecksumBytes = 2;

std::size_t bytes_of(Checksum checksum) noexcept {
  return checksum == Checksum::none ? 0 : kChecksumBytes;
}

std::size_t width_of(const ReportField& field) noexcept {
  return field.bits / 8;
}

// --- one integer ------------------------------------------------------------------------------------------

std::uint32_t raw(const ReportField& field, Bytes bytes, std::size_t index = 0) noexcept {
  if (!field.present) return 0;
  const std::size_t at = field.byte + index * width_of(field);
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < width_of(field); ++i) value |= std::uint32_t{bytes[at + i]} << (8 * i);
  return value;
}

void put_raw(const ReportField& field, std::uint32_t value, MutableBytes bytes,
             std::size_t index = 0) noexcept {
  if (!field.present) return;
  const std::size_t at = field.byte + index * width_of(field);
  for (std::size_t i = 0; i < width_of(field); ++i)
    bytes[at + i] = static_cast<std::uint8_t>((value >> (8 * i)) & 0xffu);
}

double value(const ReportField& field, Bytes bytes, std::size_t index = 0) noexcept {
  std::int64_t counts = raw(field, bytes, index);
  if (field.is_signed && (counts >> (field.bits - 1)) != 0) counts -= std::int64_t{1} << field.bits;
  return field.step * static_cast<double>(counts);
}

void put_value(const ReportField& field, double value_SI, MutableBytes bytes,
               std::size_t index = 0) noexcept {
  const double counts = std::round(value_SI / field.step);
  if (!field.present || !is_finite(counts)) return put_raw(field, 0, bytes, index);
  const double span = std::ldexp(1.0, static_cast<int>(field.bits));
  const double lowest = field.is_signed ? -0.5 * span : 0.0;
  const double clamped = std::clamp(counts, lowest, lowest + span - 1.0);
  put_raw(field, static_cast<std::uint32_t>(static_cast<std::int64_t>(clamped)), bytes, index);
}

Vector3d vector(const ReportField& field, Bytes bytes) noexcept {
  if (!field.present) return Vector3d::Zero();
  return {value(field, bytes, 0), value(field, bytes, 1), value(field, bytes, 2)};
}

void put_vector(const ReportField& field, const Vector3d& v, MutableBytes bytes) noexcept {
  put_value(field, v.x(), bytes, 0);
  put_value(field, v.y(), bytes, 1);
  put_value(field, v.z(), bytes, 2);
}

bool bit(const ReportBit& field, Bytes bytes) noexcept {
  return field.present && ((bytes[field.byte] >> field.bit) & 1u) != 0;
}

void put_bit(const ReportBit& field, bool on, MutableBytes bytes) noexcept {
  if (!field.present || !on) return;
  bytes[field.byte] = static_cast<std::uint8_t>(bytes[field.byte] | (1u << field.bit));
}

// --- the frame around the integers ------------------------------------------------------------------------

template <class Layout>
Decoding judge(const Layout& layout, Bytes bytes) noexcept {
  if (bytes.size() != layout.length) return Decoding::wrong_length;
  if (bytes[0] != layout.id) return Decoding::wrong_id;
  if (layout.checksum == Checksum::none) return Decoding::ok;
  const std::size_t end = layout.length - kChecksumBytes;
  const unsigned stored = bytes[end] | (unsigned{bytes[end + 1]} << 8);
  return stored == crc16_ccitt_false(bytes.first(end)) ? Decoding::ok : Decoding::bad_checksum;
}

template <class Layout>
void put_checksum(const Layout& layout, MutableBytes bytes) noexcept {
  if (layout.checksum == Checksum::none) return;
  const std::size_t end = layout.length - kChecksumBytes;
  const unsigned crc = crc16_ccitt_false(bytes.first(end));
  bytes[end] = static_cast<std::uint8_t>(crc & 0xffu);
  bytes[end + 1] = static_cast<std::uint8_t>(crc >> 8);
}

// --- layouts that make sense ------------------------------------------------------------------------------

/// Who owns each bit of a report, and the refusal of a second owner.
class BitMap {
 public:
  BitMap(std::string report, std::size_t length, Checksum checksum) : report_(std::move(report)) {
    const std::size_t least = 1 + bytes_of(checksum);
    if (length < least || length > kMaxReportBytes)
      refuse("length = " + std::to_string(length) + " must be " + std::to_string(least) + " to " +
             std::to_string(kMaxReportBytes) + " bytes");
    room_ = 8 * (length - bytes_of(checksum));
    claim("the report id", 0, 8);
  }

  void claim(const char* name, const ReportField& field, std::size_t count) {
    if (!field.present) return;
    const std::string field_name = name;
    if (field.bits != 8 && field.bits != 16 && field.bits != 32)
      refuse(field_name + " must be 8, 16 or 32 bits wide, not " + std::to_string(field.bits));
    if (!is_finite(field.step) || field.step == 0.0) refuse(field_name + " needs a finite step other than 0");
    if (field.count != count)
      refuse(field_name + " must hold " + std::to_string(count) + " integers, not " +
             std::to_string(field.count));
    claim(name, 8 * field.byte, field.bits * count);
  }

  void claim(const char* name, const ReportBit& field) {
    if (!field.present) return;
    if (field.bit > 7) refuse(std::string(name) + " must be one of the bits 0 to 7 of its byte");
    claim(name, 8 * field.byte + field.bit, 1);
  }

  void need(const char* name, const ReportField& field) const {
    if (!field.present) refuse(std::string(name) + " is missing; a device without it cannot be used");
  }

 private:
  void claim(const char* name, std::size_t first, std::size_t bits) {
    if (first >= room_ || bits > room_ - first)
      refuse(std::string(name) + " at byte " + std::to_string(first / 8) +
             " does not fit: the fields end at byte " + std::to_string(room_ / 8) +
             ", before the checksum if there is one");
    for (std::size_t i = first; i < first + bits; ++i) {
      if (owner_[i] != nullptr)
        refuse(std::string(name) + " overlaps " + owner_[i] + " at byte " + std::to_string(i / 8));
      owner_[i] = name;
    }
  }

  [[noreturn]] void refuse(const std::string& why) const {
    throw std::invalid_argument(report_ + ": " + why);
  }

  std::string report_;
  std::size_t room_ = 0;  ///< bits before the checksum
  std::array<const char*, 8 * kMaxReportBytes> owner_{};
};

}  // namespace

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  const Decoding outcome = judge(layout, bytes);
  if (outcome != Decoding::ok) return {outcome, {}};
  PoseReport report;
  report.X_BH.translation_m = vector(layout.position, bytes);
  report.X_BH.rotation.coeffs() << vector(layout.orientation, bytes), value(layout.orientation, bytes, 3);
  report.V_BH = {vector(layout.linear_velocity, bytes), vector(layout.angular_velocity, bytes)};
  report.sequence = raw(layout.sequence, bytes);
  report.device_time = raw(layout.device_time, bytes);
  report.acknowledged = raw(layout.acknowledged, bytes);
  report.buttons = raw(layout.buttons, bytes);
  report.motors_on = bit(layout.motors_on, bytes);
  report.watchdog_tripped = bit(layout.watchdog_tripped, bytes);
  return {outcome, report};
}

Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  const Decoding outcome = judge(layout, bytes);
  if (outcome != Decoding::ok) return {outcome, {}};
  WrenchReport report;
  report.F = {vector(layout.force, bytes), vector(layout.torque, bytes)};
  report.hold_time_s = layout.hold_time.present ? value(layout.hold_time, bytes) : 0.0;
  report.sequence = raw(layout.sequence, bytes);
  report.enable = bit(layout.enable, bytes);
  return {outcome, report};
}

std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const MutableBytes out = bytes.first(layout.length);
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  out[0] = layout.id;
  put_vector(layout.position, report.X_BH.translation_m, out);
  put_vector(layout.orientation, report.X_BH.rotation.vec(), out);
  put_value(layout.orientation, report.X_BH.rotation.w(), out, 3);
  put_vector(layout.linear_velocity, report.V_BH.linear_m_per_s, out);
  put_vector(layout.angular_velocity, report.V_BH.angular_rad_per_s, out);
  put_raw(layout.sequence, report.sequence, out);
  put_raw(layout.device_time, report.device_time, out);
  put_raw(layout.acknowledged, report.acknowledged, out);
  put_raw(layout.buttons, report.buttons, out);
  put_bit(layout.motors_on, report.motors_on, out);
  put_bit(layout.watchdog_tripped, report.watchdog_tripped, out);
  put_checksum(layout, out);
  return layout.length;
}

std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const MutableBytes out = bytes.first(layout.length);
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  out[0] = layout.id;
  put_vector(layout.force, report.F.force_N, out);
  put_vector(layout.torque, report.F.torque_Nm, out);
  put_value(layout.hold_time, report.hold_time_s, out);
  put_raw(layout.sequence, report.sequence, out);
  put_bit(layout.enable, report.enable, out);
  put_checksum(layout, out);
  return layout.length;
}

void check(const PoseReportLayout& layout) {
  BitMap map("pose_report", layout.length, layout.checksum);
  map.need("position", layout.position);
  map.need("orientation", layout.orientation);
  map.claim("motors_on", layout.motors_on);
  map.claim("watchdog_tripped", layout.watchdog_tripped);
  map.claim("sequence", layout.sequence, 1);
  map.claim("device_time", layout.device_time, 1);
  map.claim("position", layout.position, 3);
  map.claim("orientation", layout.orientation, 4);
  map.claim("linear_velocity", layout.linear_velocity, 3);
  map.claim("angular_velocity", layout.angular_velocity, 3);
  map.claim("buttons", layout.buttons, 1);
  map.claim("acknowledged", layout.acknowledged, 1);
}

void check(const WrenchReportLayout& layout) {
  BitMap map("wrench_report", layout.length, layout.checksum);
  map.need("force", layout.force);
  map.need("torque", layout.torque);
  map.claim("enable", layout.enable);
  map.claim("sequence", layout.sequence, 1);
  map.claim("force", layout.force, 3);
  map.claim("torque", layout.torque, 3);
  map.claim("hold_time", layout.hold_time, 1);
}

std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept {
  boost::crc_ccitt_false_t crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return static_cast<std::uint16_t>(crc.checksum());
}

}  // namespace wrenchd
