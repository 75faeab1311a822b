// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include <boost/crc.hpp>
#include <boost/endian/conversion.hpp>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

using Bytes = std::span<const std::uint8_t>;
using MutableBytes = std::span<std::uint8_t>;

std::size_t bytes_of(Checksum checksum) noexcept {
  switch (checksum) {
    case Checksum::none:
      return 0;
    case Checksum::crc16_ccitt_false:
      return 2;
    case Checksum::sum8:
    case Checksum::xor8:
      return 1;
  }
  return 0;
}

constexpr unsigned kBitsPerNibble = 4;

/// Bits from the start of one integer to the start of the next.
std::size_t stride_of(const ReportField& field) noexcept {
  return field.coding == Coding::nibble_ascii ? std::size_t{8} * (field.bits / kBitsPerNibble) : field.bits;
}

std::uint64_t mask_of(unsigned bits) noexcept {
  return bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
}

// --- one integer ------------------------------------------------------------------------------------------
//
// An integer is a row of pieces, each within one byte, the least significant piece first: bytes and parts of
// bytes, or nibbles that have a byte each. walk() names byte, first bit and width of each, and how far up in
// the integer the piece belongs.

template <class Visit>
void simd(const ReportField& field, std::size_t index, Visit visit) noexcept {
  const std::size_t first = 8 * field.byte + field.bit + index * stride_of(field);
  if (field.coding == Coding::nibble_ascii || field.big_endian) {
    const unsigned width = field.coding == Coding::nibble_ascii ? kBitsPerNibble : 8;
    const unsigned pieces = field.bits / width;
    for (unsigned i = 0; i < pieces; ++i)
      visit(first / 8 + (field.big_endian ? pieces - 1 - i : i), 0u, width, width * i);
    return;
  }
  for (unsigned done = 0; done < field.bits;) {
    const std::size_t at = first + done;
    const unsigned bit = static_cast<unsigned>(at % 8);
    const unsigned width = std::min(8 - bit, field.bits - done);
    visit(at / 8, bit, width, done);
    done += width;
  }
}

/// Most integers are whole bytes in the order of processors, and taken at one go.
bool is_plain(const ReportField& field) noexcept {
  return field.coding == Coding::binary && !field.big_endian && field.base == 0 && field.bit == 0 &&
         (field.bits == 8 || field.bits == 16 || field.bits == 32 || field.bits == 64);
}

std::uint64_t plain_integer(unsigned bits, const std::uint8_t* at) noexcept {
  using boost::endian::endian_load;
  constexpr auto kLittle = boost::endian::order::little;
  switch (bits) {
    case 8:
      return *at;
    case 16:
      return endian_load<std::uint16_t, 2, kLittle>(at);
    case 32:
      return endian_load<std::uint32_t, 4, kLittle>(at);
    default:
      return endian_load<std::uint64_t, 8, kLittle>(at);
  }
}

void put_plain(unsigned bits, std::uint64_t value, std::uint8_t* at) noexcept {
  using boost::endian::endian_store;
  constexpr auto kLittle = boost::endian::order::little;
  switch (bits) {
    case 8:
      *at = static_cast<std::uint8_t>(value);
      return;
    case 16:
      return endian_store<std::uint16_t, 2, kLittle>(at, static_cast<std::uint16_t>(value));
    case 32:
      return endian_store<std::uint32_t, 4, kLittle>(at, static_cast<std::uint32_t>(value));
    default:
      return endian_store<std::uint64_t, 8, kLittle>(at, value);
  }
}

void put_raw(const ReportField& field, std::uint64_t value, MutableBytes bytes,
             std::size_t index = 0) noexcept {
  if (!field.present) return;
  if (is_plain(field)) return put_plain(field.bits, value, &bytes[field.byte + index * field.bits / 8]);
  simd(field, index, [&](std::size_t byte, unsigned bit, unsigned width, unsigned up) {
    const unsigned mask = static_cast<unsigned>(mask_of(width)) << bit;
    const unsigned piece = static_cast<unsigned>(value >> up) << bit;
    const unsigned old = static_cast<std::uint8_t>(bytes[byte] - field.base);
    bytes[byte] = static_cast<std::uint8_t>(((old & ~mask) | (piece & mask)) + field.base);
  });
}

double value(const ReportField& field, Bytes bytes, std::size_t index = 0) noexcept {
  const std::uint64_t raw = raw_integer(field, bytes, index);
  const double counts =
      field.is_signed ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
  return field.step * counts + field.offset;
}

/// The integer nearest to `counts` that the field can hold.
std::uint64_t saturated(const ReportField& field, double counts) noexcept {
  const std::uint64_t all = mask_of(field.bits);
  const double end = static_cast<double>(std::uint64_t{1} << (field.bits - 1));  // half way
  if (!field.is_signed) {
    if (counts <= 0.0) return 0;
    return counts >= 2.0 * end ? all : static_cast<std::uint64_t>(counts);
  }
  if (counts >= end) return all >> 1;
  if (counts <= -end) return (all >> 1) + 1;
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(counts)) & all;
}

void put_value(const ReportField& field, double value_SI, MutableBytes bytes,
               std::size_t index = 0) noexcept {
  const double counts = std::round((value_SI - field.offset) / field.step);
  put_raw(field, field.present && is_finite(counts) ? saturated(field, counts) : 0, bytes, index);
}

Vector3d vector(const ReportField& field, Bytes bytes) noexcept {
  return {value(field, bytes, 0), value(field, bytes, 1), value(field, bytes, 2)};
}

void put_vector(const ReportField& field, const Vector3d& v, MutableBytes bytes) noexcept {
  put_value(field, v.x(), bytes, 0);
  put_value(field, v.y(), bytes, 1);
  put_value(field, v.z(), bytes, 2);
}

void put_bit(const ReportBit& field, bool on, MutableBytes bytes) noexcept {
  if (!field.present || !on) return;
  const unsigned old = static_cast<std::uint8_t>(bytes[field.byte] - field.base);
  bytes[field.byte] = static_cast<std::uint8_t>((old | (1u << field.bit)) + field.base);
}

/// Every byte of a field starts as the character that stands for zero.
void put_base(const ReportField& field, MutableBytes bytes) noexcept {
  if (!field.present || field.base == 0) return;
  const std::size_t last = (8 * field.byte + field.bit + field.count * stride_of(field) - 1) / 8;
  for (std::size_t i = field.byte; i <= last; ++i) bytes[i] = field.base;
}

void put_base(const ReportBit& field, MutableBytes bytes) noexcept {
  if (field.present && field.base != 0) bytes[field.byte] = field.base;
}

// --- the frame around the integers ------------------------------------------------------------------------

std::size_t checksum_slot(const ReportFrame& frame) noexcept {
  return frame.checksum_at.value_or(frame.length - bytes_of(frame.checksum));
}

std::uint16_t checksum_over(Checksum checksum, Bytes bytes) noexcept {
  unsigned sum = 0;
  switch (checksum) {
    case Checksum::none:
      return 0;
    case Checksum::crc16_ccitt_false:
      return crc16_ccitt_false(bytes);
    case Checksum::sum8:
      for (const std::uint8_t byte : bytes) sum += byte;
      break;
    case Checksum::xor8:
      for (const std::uint8_t byte : bytes) sum ^= byte;
      break;
  }
  return static_cast<std::uint16_t>(sum & 0xffu);
}

std::uint16_t checksum_of(const ReportFrame& frame, Bytes bytes) noexcept {
  const std::size_t slot = checksum_slot(frame);
  return checksum_over(frame.checksum, bytes.first(slot).subspan(frame.checksum_from));
}

bool has_length_of(const ReportFrame& frame, std::size_t length) noexcept {
  const std::size_t least = frame.min_length == 0 ? frame.length : frame.min_length;
  return length >= least && length <= frame.length;
}

Decoding judge(const ReportFrame& frame, Bytes bytes) noexcept {
  if (!has_length_of(frame, bytes.size())) return Decoding::wrong_length;
  if (frame.has_id && bytes[0] != frame.id) return Decoding::wrong_id;
  for (const auto& [byte, value] : frame.constants)
    if (byte < bytes.size() && bytes[byte] != value) return Decoding::wrong_marker;
  if (frame.checksum == Checksum::none) return Decoding::ok;
  const std::size_t slot = checksum_slot(frame);
  unsigned stored = bytes[slot];
  if (bytes_of(frame.checksum) == 2) stored |= unsigned{bytes[slot + 1]} << 8;
  return stored == checksum_of(frame, bytes) ? Decoding::ok : Decoding::bad_checksum;
}

/// Zeros, or what the layout has in their place; then the id.
template <class Layout>
MutableBytes begin(const Layout& layout, MutableBytes bytes) noexcept {
  const MutableBytes out = bytes.first(layout.length);
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  if constexpr (requires { layout.template_bytes; })
    std::copy_n(layout.template_bytes.begin(), std::min(layout.template_bytes.size(), out.size()),
                out.begin());
  if (layout.has_id) out[0] = layout.id;
  return out;
}

void finish(const ReportFrame& frame, MutableBytes bytes) noexcept {
  for (const auto& [byte, value] : frame.constants) bytes[byte] = value;
  if (frame.checksum == Checksum::none) return;
  const std::size_t slot = checksum_slot(frame);
  const unsigned sum = checksum_of(frame, bytes);
  bytes[slot] = static_cast<std::uint8_t>(sum & 0xffu);
  if (bytes_of(frame.checksum) == 2) bytes[slot + 1] = static_cast<std::uint8_t>(sum >> 8);
}

// --- layouts that make sense ------------------------------------------------------------------------------

/// Who owns each bit of a report, and the refusal of a second owner.
class BitMap {
 public:
  BitMap(std::string report, const ReportFrame& frame) : report_(std::move(report)) {
    const std::size_t tail = frame.checksum_at ? 0 : bytes_of(frame.checksum);
    const std::size_t least = std::max<std::size_t>((frame.has_id ? 1 : 0) + tail, 1);
    if (frame.length < least || frame.length > kMaxReportBytes)
      refuse("length = " + std::to_string(frame.length) + " must be " + std::to_string(least) + " to " +
             std::to_string(kMaxReportBytes) + " bytes");
    if (frame.min_length > frame.length || (frame.min_length != 0 && frame.checksum != Checksum::none))
      refuse("min_length = " + std::to_string(frame.min_length) +
             " must not exceed length, and must not be stated together with a checksum");
    if (frame.min_length == 0 && frame.length < least) refuse("is empty");
    room_ = 8 * (frame.length - tail);
    if (frame.has_id) claim("the report id", 0, 8);
    if (frame.checksum_at) {
      if (*frame.checksum_at >= kMaxReportBytes) refuse("the checksum does not fit");
      claim("the checksum", 8 * *frame.checksum_at, 8 * bytes_of(frame.checksum));
    }
    if (frame.checksum != Checksum::none && frame.checksum_from >= checksum_slot(frame))
      refuse("the checksum covers nothing: checksum_from = " + std::to_string(frame.checksum_from) +
             " must be before it");
    for (const ReportConstant& constant : frame.constants) claim_byte("a constant byte", constant.byte);
  }

  void claim(const char* name, const ReportField& field, std::size_t count) {
    if (!field.present) return;
    const std::string field_name = name;
    if (field.bits < 1 || field.bits > 64)
      refuse(field_name + " must be 1 to 64 bits wide, not " + std::to_string(field.bits));
    if (field.bit > 7) refuse(field_name + " must start at one of the bits 0 to 7 of its byte");
    if (field.coding == Coding::nibble_ascii && (field.bits % kBitsPerNibble != 0 || field.bit != 0))
      refuse(field_name +
             " is coded as nibbles, so its width must be a multiple of 4 and it starts at bit 0");
    if (field.big_endian && field.coding == Coding::binary && (field.bits % 8 != 0 || field.bit != 0))
      refuse(field_name + " is big-endian, so it must be made of whole bytes");
    if (!is_finite(field.step) || field.step == 0.0) refuse(field_name + " needs a finite step other than 0");
    if (!is_finite(field.offset)) refuse(field_name + " needs a finite offset");
    if (field.count != count)
      refuse(field_name + " must hold " + std::to_string(count) + " integers, not " +
             std::to_string(field.count));
    if (field.byte >= kMaxReportBytes) refuse_place(name, field.byte);
    claim(name, 8 * field.byte + field.bit, stride_of(field) * count);
  }

  void claim(const char* name, const ReportBit& field) {
    if (!field.present) return;
    if (field.bit > 7) refuse(std::string(name) + " must be one of the bits 0 to 7 of its byte");
    if (field.byte >= kMaxReportBytes) refuse_place(name, field.byte);
    claim(name, 8 * field.byte + field.bit, 1);
  }

  void claim(const char* name, const std::vector<ReportBit>& bits) {
    for (const ReportBit& bit : bits) claim(name, bit);
  }

  void need(const char* name, const ReportField& field) const {
    if (!field.present) refuse(std::string(name) + " is missing; a device without it cannot be used");
  }

  [[noreturn]] void refuse(const std::string& why) const {
    throw std::invalid_argument(report_ + ": " + why);
  }

 private:
  void claim_byte(const char* name, std::size_t byte) {
    if (byte >= kMaxReportBytes) refuse_place(name, byte);
    claim(name, 8 * byte, 8);
  }

  [[noreturn]] void refuse_place(const char* name, std::size_t byte) const {
    refuse(std::string(name) + " at byte " + std::to_string(byte) + " does not fit: the fields end at byte " +
           std::to_string(room_ / 8) + ", before the checksum if there is one");
  }

  void claim(const char* name, std::size_t first, std::size_t bits) {
    if (first >= room_ || bits > room_ - first) refuse_place(name, first / 8);
    for (std::size_t i = first; i < first + bits; ++i) {
      if (owner_[i] != nullptr)
        refuse(std::string(name) + " overlaps " + owner_[i] + " at byte " + std::to_string(i / 8));
      owner_[i] = name;
    }
  }

  std::string report_;
  std::size_t room_ = 0;  ///< bits before the checksum
  std::array<const char*, 8 * kMaxReportBytes> owner_{};
};

/// Part of a pose that only kinematics or an integrator turns into one.
bool is_raw(const PoseReportLayout& layout) noexcept {
  return layout.joints.present || layout.translation.present || layout.rotation.present;
}

BitMap claimed(const PoseReportLayout& layout) {
  BitMap map(layout.name.empty() ? "pose_report" : "report " + layout.name, layout);
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
  map.claim("translation", layout.translation, 3);
  map.claim("rotation", layout.rotation, 3);
  map.claim("joints", layout.joints, std::min(layout.joints.count, kMaxJoints));
  map.claim("a button", layout.button_bits);
  map.claim("a bit of homed", layout.homed);
  for (const NamedBit& status : layout.status) map.claim("a status bit", status.bit);
  for (const NamedField& named : layout.values) map.claim("a value", named.field, 1);
  if (layout.button_bits.size() > 32) map.refuse("has more than 32 buttons");
  return map;
}

void check_distinguishable(const PoseReportLayout& a, const PoseReportLayout& b) {
  const bool ids = a.has_id && b.has_id;
  if (a.has_id != b.has_id)
    throw std::invalid_argument(
        "reports with an id and without one cannot be distinguished; a device has either kind");
  if (ids && a.id != b.id) return;
  const auto least = [](const ReportFrame& r) { return r.min_length == 0 ? r.length : r.min_length; };
  if (least(a) > b.length || least(b) > a.length) return;
  throw std::invalid_argument("two reports have the same " + std::string(ids ? "id" : "length") +
                              " and cannot be distinguished");
}

/// Whether the reports make a pose together.
void check_pose(const DeviceProfile& profile, const std::vector<const PoseReportLayout*>& layouts) {
  const auto any = [&](ReportField PoseReportLayout::*field) {
    return std::any_of(layouts.begin(), layouts.end(), [&](const auto* l) { return (l->*field).present; });
  };
  const auto refuse = [](const char* why) { throw std::invalid_argument(why); };
  const bool joints = any(&PoseReportLayout::joints);
  const bool deflection = any(&PoseReportLayout::translation) || any(&PoseReportLayout::rotation);
  switch (pose_source(profile)) {
    case PoseSource::joints:
      if (!joints) refuse("kinematics is stated, but no report carries joints");
      for (const auto* l : layouts)
        if (l->joints.present && l->joints.count < profile.kinematics.joints)
          refuse("joints holds fewer integers than kinematics has joints");
      return;
    case PoseSource::deflection:
      if (!deflection) refuse("deflection is stated, but no report carries a translation or a rotation");
      return;
    case PoseSource::pose:
      if (joints) refuse("a report carries joints, but kinematics is not stated");
      if (deflection) refuse("a report carries a translation or rotation, but deflection is not stated");
      if (!any(&PoseReportLayout::position))
        refuse("position is missing; a device without it cannot be used");
      return;
  }
}

}  // namespace

std::uint64_t raw_integer(const ReportField& field, std::span<const std::uint8_t> bytes,
                          std::size_t index) noexcept {
  if (!field.present) return 0;
  std::uint64_t value = 0;
  const std::size_t first = field.byte + index * field.bits / 8;
  if (is_plain(field) && first + field.bits / 8 <= bytes.size()) {
    value = plain_integer(field.bits, &bytes[first]);
  } else {
    simd(field, index, [&](std::size_t byte, unsigned bit, unsigned width, unsigned up) {
      if (byte >= bytes.size()) return;
      const unsigned piece = static_cast<std::uint8_t>(bytes[byte] - field.base);
      value |= ((std::uint64_t{piece} >> bit) & mask_of(width)) << up;
    });
  }
  if (field.is_signed && (value >> (field.bits - 1)) != 0) value |= ~mask_of(field.bits);
  return value;
}

double field_value(const ReportField& field, std::span<const std::uint8_t> bytes,
                   std::size_t index) noexcept {
  return field.present ? value(field, bytes, index) : 0.0;
}

bool bit_value(const ReportBit& field, std::span<const std::uint8_t> bytes) noexcept {
  if (!field.present || field.byte >= bytes.size()) return false;
  return (static_cast<std::uint8_t>(bytes[field.byte] - field.base) >> field.bit & 1u) != 0;
}

Decoding decode_into(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes,
                     PoseReport& report) noexcept {
  const Decoding outcome = judge(layout, bytes);
  if (outcome != Decoding::ok) return outcome;
  if (layout.position.present) report.X_BH.translation_m = vector(layout.position, bytes);
  if (layout.orientation.present)
    report.X_BH.rotation.coeffs() << vector(layout.orientation, bytes), value(layout.orientation, bytes, 3);
  if (layout.linear_velocity.present) report.V_BH.linear_m_per_s = vector(layout.linear_velocity, bytes);
  if (layout.angular_velocity.present) report.V_BH.angular_rad_per_s = vector(layout.angular_velocity, bytes);
  if (layout.translation.present) report.translation_m = vector(layout.translation, bytes);
  if (layout.rotation.present) report.rotation_rad = vector(layout.rotation, bytes);
  if (layout.joints.present)
    for (std::size_t i = 0; i < std::min(layout.joints.count, kMaxJoints); ++i)
      report.joints[i] = value(layout.joints, bytes, i);
  if (layout.sequence.present) report.sequence = raw_integer(layout.sequence, bytes);
  if (layout.device_time.present) report.device_time = raw_integer(layout.device_time, bytes);
  if (layout.acknowledged.present) report.acknowledged = raw_integer(layout.acknowledged, bytes);
  if (layout.buttons.present) report.buttons = static_cast<std::uint32_t>(raw_integer(layout.buttons, bytes));
  if (!layout.button_bits.empty()) report.buttons = 0;
  for (std::size_t i = 0; i < layout.button_bits.size(); ++i)
    if (bit_value(layout.button_bits[i], bytes)) report.buttons |= std::uint32_t{1} << i;
  if (layout.motors_on.present) report.motors_on = bit_value(layout.motors_on, bytes);
  if (layout.watchdog_tripped.present) report.watchdog_tripped = bit_value(layout.watchdog_tripped, bytes);
  if (!layout.homed.empty())
    report.homed = std::all_of(layout.homed.begin(), layout.homed.end(),
                               [&](const ReportBit& bit) { return bit_value(bit, bytes); });
  return outcome;
}

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  Decoded<PoseReport> decoded;
  decoded.outcome = decode_into(layout, bytes, decoded.report);
  return decoded;
}

Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  const Decoding outcome = judge(layout, bytes);
  if (outcome != Decoding::ok) return {outcome, {}};
  WrenchReport report;
  if (layout.force.present) report.F.force_N = vector(layout.force, bytes);
  if (layout.torque.present) report.F.torque_Nm = vector(layout.torque, bytes);
  if (layout.efforts.present)
    for (std::size_t i = 0; i < kMaxMotors; ++i) report.efforts[i] = value(layout.efforts, bytes, i);
  report.hold_time_s = layout.hold_time.present ? value(layout.hold_time, bytes) : 0.0;
  report.sequence = raw_integer(layout.sequence, bytes);
  report.enable = bit_value(layout.enable, bytes);
  return {outcome, report};
}

std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const MutableBytes out = begin(layout, bytes);
  for (const ReportField* field :
       {&layout.sequence, &layout.device_time, &layout.position, &layout.orientation, &layout.linear_velocity,
        &layout.angular_velocity, &layout.acknowledged, &layout.buttons, &layout.translation,
        &layout.rotation, &layout.joints})
    put_base(*field, out);
  put_base(layout.motors_on, out);
  put_base(layout.watchdog_tripped, out);
  for (const ReportBit& bit : layout.button_bits) put_base(bit, out);
  for (const ReportBit& bit : layout.homed) put_base(bit, out);
  put_vector(layout.position, report.X_BH.translation_m, out);
  put_vector(layout.orientation, report.X_BH.rotation.vec(), out);
  put_value(layout.orientation, report.X_BH.rotation.w(), out, 3);
  put_vector(layout.linear_velocity, report.V_BH.linear_m_per_s, out);
  put_vector(layout.angular_velocity, report.V_BH.angular_rad_per_s, out);
  put_vector(layout.translation, report.translation_m, out);
  put_vector(layout.rotation, report.rotation_rad, out);
  for (std::size_t i = 0; i < std::min(layout.joints.count, kMaxJoints); ++i)
    put_value(layout.joints, report.joints[i], out, i);
  put_raw(layout.sequence, report.sequence, out);
  put_raw(layout.device_time, report.device_time, out);
  put_raw(layout.acknowledged, report.acknowledged, out);
  put_raw(layout.buttons, report.buttons, out);
  for (std::size_t i = 0; i < layout.button_bits.size(); ++i)
    put_bit(layout.button_bits[i], (report.buttons >> i & 1u) != 0, out);
  put_bit(layout.motors_on, report.motors_on, out);
  put_bit(layout.watchdog_tripped, report.watchdog_tripped, out);
  for (const ReportBit& bit : layout.homed) put_bit(bit, report.homed, out);
  finish(layout, out);
  return layout.length;
}

std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const MutableBytes out = begin(layout, bytes);
  for (const ReportField* field :
       {&layout.sequence, &layout.force, &layout.torque, &layout.efforts, &layout.hold_time})
    put_base(*field, out);
  put_base(layout.enable, out);
  put_vector(layout.force, report.F.force_N, out);
  put_vector(layout.torque, report.F.torque_Nm, out);
  for (std::size_t i = 0; i < kMaxMotors; ++i) put_value(layout.efforts, report.efforts[i], out, i);
  put_value(layout.hold_time, report.hold_time_s, out);
  put_raw(layout.sequence, report.sequence, out);
  put_bit(layout.enable, report.enable, out);
  finish(layout, out);
  return layout.length;
}

void check(const PoseReportLayout& layout) {
  const BitMap map = claimed(layout);
  if (!is_raw(layout)) map.need("position", layout.position);
}

void check(const WrenchReportLayout& layout) {
  BitMap map("wrench_report", layout);
  if (!layout.template_bytes.empty() && layout.template_bytes.size() != layout.length)
    map.refuse("template has " + std::to_string(layout.template_bytes.size()) +
               " bytes and must have the length of the report, " + std::to_string(layout.length));
  if (!layout.efforts.present) map.need("force", layout.force);
  if (layout.efforts.present && (layout.force.present || layout.torque.present))
    map.refuse("efforts replace force and torque; leave one of the two out");
  map.claim("enable", layout.enable);
  map.claim("sequence", layout.sequence, 1);
  map.claim("force", layout.force, 3);
  map.claim("torque", layout.torque, 3);
  map.claim("efforts", layout.efforts, kMaxMotors);
  map.claim("hold_time", layout.hold_time, 1);
}

void check_reports(const DeviceProfile& profile) {
  std::vector<const PoseReportLayout*> layouts = {&profile.pose_report};
  for (const PoseReportLayout& layout : profile.more_reports) layouts.push_back(&layout);
  for (std::size_t i = 0; i < layouts.size(); ++i) {
    claimed(*layouts[i]);
    for (std::size_t j = 0; j < i; ++j) check_distinguishable(*layouts[j], *layouts[i]);
  }
  check_pose(profile, layouts);
  if (!profile.has_output) return;
  check(profile.wrench_report);
  if (profile.wrench_report.efforts.present && profile.kinematics.kind == Kinematics::Kind::none)
    throw std::invalid_argument("wrench_report: efforts require [kinematics]");
  if (profile.max_torque_Nm > 0.0 && !profile.wrench_report.torque.present)
    throw std::invalid_argument(
        "wrench_report: torque is missing, though max_torque_Nm is stated; a device without torque states "
        "no such limit");
}

std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept {
  boost::crc_ccitt_false_t crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return static_cast<std::uint16_t>(crc.checksum());
}

}  // namespace wrenchd
