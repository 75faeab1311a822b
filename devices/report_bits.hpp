// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

// Integers and single bits of a report. The layout must be valid (devices/layout_validation.hpp), and writing
// needs all bytes of the report. All functions are RT-safe.
//
//   value = step * raw + offset        raw: little-endian unless the field states otherwise; two's complement
//                                      if signed

inline constexpr unsigned kBitsPerNibble = 4;

/// Returns the number of bits from the start of one integer of a field to the start of the next. RT-safe.
std::size_t integer_stride(const ReportField& field) noexcept;

// --- reading ---

/// Returns the raw integer, sign-extended to 64 bits if the field is signed. Absent fields and missing bytes
/// read as 0. RT-safe.
std::uint64_t raw_integer(const ReportField& field, std::span<const std::uint8_t> bytes,
                          std::size_t index = 0) noexcept;
/// Returns the SI value of an integer; 0 if the field is absent. RT-safe.
double field_value(const ReportField& field, std::span<const std::uint8_t> bytes,
                   std::size_t index = 0) noexcept;
/// Returns the SI values of the first three integers. RT-safe.
Vector3d field_vector(const ReportField& field, std::span<const std::uint8_t> bytes) noexcept;
/// Returns the value of a bit; false if it is absent. RT-safe.
bool bit_value(const ReportBit& bit, std::span<const std::uint8_t> bytes) noexcept;

// --- writing ---

/// Writes the low bits of `raw`. Does nothing if the field is absent. RT-safe.
void put_raw(const ReportField& field, std::uint64_t raw, std::span<std::uint8_t> bytes,
             std::size_t index = 0) noexcept;
/// Writes an SI value: rounds it to the nearest count, ties away from zero, and clamps it to the range of the
/// field. A value that is not finite becomes raw 0. RT-safe.
void put_value(const ReportField& field, double value_SI, std::span<std::uint8_t> bytes,
               std::size_t index = 0) noexcept;
/// Writes SI values to the first three integers. RT-safe.
void put_vector(const ReportField& field, const Vector3d& v, std::span<std::uint8_t> bytes) noexcept;
/// Sets a bit if `on`; otherwise changes nothing. RT-safe.
void put_bit(const ReportBit& bit, bool on, std::span<std::uint8_t> bytes) noexcept;
/// Sets the bytes of a field to their base, the character of zero. Call it before put_*(). RT-safe.
void put_base(const ReportField& field, std::span<std::uint8_t> bytes) noexcept;
void put_base(const ReportBit& bit, std::span<std::uint8_t> bytes) noexcept;

}  // namespace wrenchd
