// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "tests/support/firmware_in_hand.hpp"

namespace wrenchd::test {

/// Offsets of fields in the pose report of the open layout.
inline constexpr std::size_t kVelocity = 36, kOrientation = 20, kAcknowledged = 61;

inline std::uint16_t u16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8));
}
inline std::int32_t i32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::int32_t>(u16(bytes, at) | (static_cast<std::uint32_t>(u16(bytes, at + 2)) << 16U));
}
inline void put_i32(std::span<std::uint8_t> bytes, std::size_t at, std::int32_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    bytes[at + i] = static_cast<std::uint8_t>((static_cast<std::uint32_t>(value) >> (8 * i)) & 0xFFU);
}

/// A mistake in the reports; the checksum is right.
inline FirmwareMistakes in_reports(std::function<void(ReportBytes&)> change) {
  FirmwareMistakes m;
  m.report = [change](ReportBytes& bytes) {
    change(bytes);
    seal(bytes);
  };
  return m;
}
inline FirmwareMistakes in_commands(std::function<void(CommandBytes&, wf_firmware&)> change) {
  FirmwareMistakes m;
  m.command = std::move(change);
  return m;
}
inline FirmwareMistakes in_motors(std::function<void(wf_wrench&)> change) {
  FirmwareMistakes m;
  m.wrench = std::move(change);
  return m;
}

}  // namespace wrenchd::test
