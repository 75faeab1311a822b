// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"

namespace wrenchd {

// Frame of a report: length, report id, constant bytes and checksum. The layout must be valid
// (devices/layout_validation.hpp). All functions are RT-safe.

/// Length of the longest report: one packet of a full-speed interrupt endpoint.
inline constexpr std::size_t kMaxReportBytes = 64;

/// Result of decoding: whether the bytes match the layout, and if not, why.
enum class Decoding : std::uint8_t { ok, wrong_length, wrong_id, bad_checksum, wrong_marker };

/// Compares length, id, constants and checksum of a received report with its layout. RT-safe.
Decoding check_frame(const ReportFrame& frame, std::span<const std::uint8_t> bytes) noexcept;

/// Prepares the first `frame.length` bytes of `bytes` for the fields: copies the template and fills the
/// remaining bytes with zeros, then writes the id. Returns these bytes. RT-safe.
std::span<std::uint8_t> begin_frame(const ReportFrame& frame, std::span<const std::uint8_t> template_bytes,
                                    std::span<std::uint8_t> bytes) noexcept;
/// Writes the constants, then the checksum. Call it after all fields are written. RT-safe.
void finish_frame(const ReportFrame& frame, std::span<std::uint8_t> bytes) noexcept;

/// Returns the minimum length of a valid report in bytes. RT-safe.
std::size_t min_report_length(const ReportFrame& frame) noexcept;
/// Returns the size of a checksum in bytes. RT-safe.
std::size_t checksum_bytes(Checksum checksum) noexcept;
/// Returns the first byte of the checksum. RT-safe.
std::size_t checksum_offset(const ReportFrame& frame) noexcept;

/// Returns the CRC-16/CCITT-FALSE: polynomial 0x1021, initial value 0xFFFF, not reflected, no final xor. The
/// check value over "123456789" is 0x29B1. RT-safe.
std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace wrenchd
