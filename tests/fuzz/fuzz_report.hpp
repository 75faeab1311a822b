// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// Steps of an input of fuzz_report. An input is one byte for the profile, then steps: one byte for the kind
/// and the bytes that the kind reads.
enum class Step : std::uint8_t {
  advance,    ///< 1 byte: advances the clock by 1 us to 0.5 s
  read,       ///< no bytes: the host reads the newest report
  raw,        ///< 1 byte: length; then the bytes of a report
  framed,     ///< 1 byte: kind of report; then its bytes; id, constants and checksum are made valid
  plausible,  ///< 1 byte: kind of report; then small changes to the previous report
  command,    ///< 1 byte: flags; then a wrench that the host writes
  link,       ///< 1 byte: loses, blocks, unblocks, releases, recalibrates or reopens the link
  sleep,      ///< 1 byte: advances the clock by 1 s to 256 s
};
inline constexpr unsigned kSteps = 8;

}  // namespace wrenchd::test
