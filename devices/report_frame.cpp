// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_frame.hpp"

#include <algorithm>

#include <boost/crc.hpp>

namespace wrenchd {
namespace {

std::uint16_t checksum_over(Checksum checksum, std::span<const std::uint8_t> bytes) noexcept {
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

std::uint16_t checksum_of(const ReportFrame& frame, std::span<const std::uint8_t> bytes) noexcept {
  const std::size_t offset = checksum_offset(frame);
  return checksum_over(frame.checksum, bytes.first(offset).subspan(frame.checksum_from));
}

}  // namespace

std::size_t min_report_length(const ReportFrame& frame) noexcept {
  return frame.min_length == 0 ? frame.length : frame.min_length;
}

std::size_t checksum_bytes(Checksum checksum) noexcept {
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

std::size_t checksum_offset(const ReportFrame& frame) noexcept {
  return frame.checksum_at.value_or(frame.length - checksum_bytes(frame.checksum));
}

Decoding check_frame(const ReportFrame& frame, std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() < min_report_length(frame) || bytes.size() > frame.length) return Decoding::wrong_length;
  if (frame.has_id && bytes[0] != frame.id) return Decoding::wrong_id;
  for (const auto& [byte, value] : frame.constants)
    if (byte < bytes.size() && bytes[byte] != value) return Decoding::wrong_marker;
  if (frame.checksum == Checksum::none) return Decoding::ok;
  const std::size_t offset = checksum_offset(frame);
  unsigned stored = bytes[offset];
  if (checksum_bytes(frame.checksum) == 2) stored |= unsigned{bytes[offset + 1]} << 8;
  return stored == checksum_of(frame, bytes) ? Decoding::ok : Decoding::bad_checksum;
}

std::span<std::uint8_t> begin_frame(const ReportFrame& frame, std::span<const std::uint8_t> template_bytes,
                                    std::span<std::uint8_t> bytes) noexcept {
  const std::span<std::uint8_t> out = bytes.first(frame.length);
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  std::copy_n(template_bytes.begin(), std::min(template_bytes.size(), out.size()), out.begin());
  if (frame.has_id) out[0] = frame.id;
  return out;
}

void finish_frame(const ReportFrame& frame, std::span<std::uint8_t> bytes) noexcept {
  for (const auto& [byte, value] : frame.constants) bytes[byte] = value;
  if (frame.checksum == Checksum::none) return;
  const std::size_t offset = checksum_offset(frame);
  const unsigned sum = checksum_of(frame, bytes);
  bytes[offset] = static_cast<std::uint8_t>(sum & 0xffu);
  if (checksum_bytes(frame.checksum) == 2) bytes[offset + 1] = static_cast<std::uint8_t>(sum >> 8);
}

std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes) noexcept {
  boost::crc_ccitt_false_t crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return static_cast<std::uint16_t>(crc.checksum());
}

}  // namespace wrenchd
