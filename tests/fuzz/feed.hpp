// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

namespace wrenchd::test {

/// The bytes of one fuzzed input, taken from the front. When they are used up everything reads as zero, so
/// that every input is a whole one.
class Feed {
 public:
  explicit Feed(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  bool empty() const noexcept { return rest_.empty(); }
  std::span<const std::uint8_t> rest() const noexcept { return rest_; }

  std::uint8_t byte() noexcept {
    if (rest_.empty()) return 0;
    const std::uint8_t first = rest_.front();
    rest_ = rest_.subspan(1);
    return first;
  }
  /// -128 to 127
  int signed_byte() noexcept { return static_cast<std::int8_t>(byte()); }
  /// Two bytes, little-endian, as -32768 to 32767.
  int signed_word() noexcept {
    const unsigned low = byte(), high = byte();
    return static_cast<std::int16_t>(low | (high << 8));
  }
  /// Fills all of `out`.
  void fill(std::span<std::uint8_t> out) noexcept {
    for (std::uint8_t& b : out) b = byte();
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// A law that does not hold is a finding: it is told, and the run ends where the fuzzer sees it.
inline void hold(bool law, const char* words) {
  if (law) return;
  std::fprintf(stderr, "does not hold: %s\n", words);
  std::abort();
}

}  // namespace wrenchd::test
