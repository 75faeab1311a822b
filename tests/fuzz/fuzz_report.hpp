// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// What the inputs of fuzz_report are made of: a byte for the profile, then steps, each a byte of its own and
/// what it needs.
enum class Step : std::uint8_t {
  pass,       ///< 1 byte: 1 us to 0.5 s
  read,       ///< the host reads
  raw,        ///< 1 byte: length; a report of any bytes
  framed,     ///< 1 byte: which report; any content with the right id, markers and checksum
  plausible,  ///< 1 byte: which report; the last one, changed by a little
  command,    ///< 1 byte: flags; then a wrench
  link,       ///< 1 byte: gone, full, free again, released, calibrated, opened anew
  sleep,      ///< 1 byte: seconds
};
inline constexpr unsigned kSteps = 8;

}  // namespace wrenchd::test
