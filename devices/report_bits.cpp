// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_bits.hpp"

#include <algorithm>
#include <cmath>

#include <boost/endian/conversion.hpp>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

std::uint64_t mask_of(unsigned bits) noexcept {
  return bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
}

/// Visits the pieces of an integer. Each piece lies within one byte: bytes and parts of bytes, or nibbles
/// with one byte each. visit() receives byte, first bit and width of the piece, and its position in the
/// integer.
template <class Visit>
void for_each_piece(const ReportField& field, std::size_t index, Visit visit) noexcept {
  const std::size_t first = 8 * field.byte + field.bit + index * integer_stride(field);
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

/// Returns true for whole bytes in the byte order of the processor, which are read and written at once.
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

/// Returns the raw integer of `counts`, clamped to the range of the field.
std::uint64_t clamped(const ReportField& field, double counts) noexcept {
  const std::uint64_t all = mask_of(field.bits);
  const double end = std::ldexp(1.0, static_cast<int>(field.bits) - 1);  // half the range
  if (!field.is_signed) {
    if (counts <= 0.0) return 0;
    return counts >= 2.0 * end ? all : static_cast<std::uint64_t>(counts);
  }
  if (counts >= end) return all >> 1;
  if (counts <= -end) return (all >> 1) + 1;
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(counts)) & all;
}

}  // namespace

std::size_t integer_stride(const ReportField& field) noexcept {
  return field.coding == Coding::nibble_ascii ? std::size_t{8} * (field.bits / kBitsPerNibble) : field.bits;
}

std::uint64_t raw_integer(const ReportField& field, std::span<const std::uint8_t> bytes,
                          std::size_t index) noexcept {
  if (!field.present) return 0;
  std::uint64_t value = 0;
  const std::size_t first = field.byte + index * field.bits / 8;
  if (is_plain(field) && first + field.bits / 8 <= bytes.size()) {
    value = plain_integer(field.bits, &bytes[first]);
  } else {
    for_each_piece(field, index, [&](std::size_t byte, unsigned bit, unsigned width, unsigned up) {
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
  if (!field.present) return 0.0;
  const std::uint64_t raw = raw_integer(field, bytes, index);
  const double counts =
      field.is_signed ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
  return field.step * counts + field.offset;
}

Vector3d field_vector(const ReportField& field, std::span<const std::uint8_t> bytes) noexcept {
  return {field_value(field, bytes, 0), field_value(field, bytes, 1), field_value(field, bytes, 2)};
}

bool bit_value(const ReportBit& field, std::span<const std::uint8_t> bytes) noexcept {
  if (!field.present || field.byte >= bytes.size()) return false;
  return (static_cast<std::uint8_t>(bytes[field.byte] - field.base) >> field.bit & 1u) != 0;
}

void put_raw(const ReportField& field, std::uint64_t raw, std::span<std::uint8_t> bytes,
             std::size_t index) noexcept {
  if (!field.present) return;
  if (is_plain(field)) return put_plain(field.bits, raw, &bytes[field.byte + index * field.bits / 8]);
  for_each_piece(field, index, [&](std::size_t byte, unsigned bit, unsigned width, unsigned up) {
    const unsigned mask = static_cast<unsigned>(mask_of(width)) << bit;
    const unsigned piece = static_cast<unsigned>(raw >> up) << bit;
    const unsigned old = static_cast<std::uint8_t>(bytes[byte] - field.base);
    bytes[byte] = static_cast<std::uint8_t>(((old & ~mask) | (piece & mask)) + field.base);
  });
}

void put_value(const ReportField& field, double value_SI, std::span<std::uint8_t> bytes,
               std::size_t index) noexcept {
  const double counts = std::round((value_SI - field.offset) / field.step);
  put_raw(field, field.present && is_finite(counts) ? clamped(field, counts) : 0, bytes, index);
}

void put_vector(const ReportField& field, const Vector3d& v, std::span<std::uint8_t> bytes) noexcept {
  put_value(field, v.x(), bytes, 0);
  put_value(field, v.y(), bytes, 1);
  put_value(field, v.z(), bytes, 2);
}

void put_bit(const ReportBit& field, bool on, std::span<std::uint8_t> bytes) noexcept {
  if (!field.present || !on) return;
  const unsigned old = static_cast<std::uint8_t>(bytes[field.byte] - field.base);
  bytes[field.byte] = static_cast<std::uint8_t>((old | (1u << field.bit)) + field.base);
}

void put_base(const ReportField& field, std::span<std::uint8_t> bytes) noexcept {
  if (!field.present || field.base == 0) return;
  const std::size_t last = (8 * field.byte + field.bit + field.count * integer_stride(field) - 1) / 8;
  for (std::size_t i = field.byte; i <= last; ++i) bytes[i] = field.base;
}

void put_base(const ReportBit& field, std::span<std::uint8_t> bytes) noexcept {
  if (field.present && field.base != 0) bytes[field.byte] = field.base;
}

}  // namespace wrenchd
