// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

namespace wrenchd::test {

/// Reads the bytes of a fuzzed input from the front. Behind the last byte all reads return zero, so every
/// input is valid.
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
  /// Returns -128 to 127.
  int signed_byte() noexcept { return static_cast<std::int8_t>(byte()); }
  /// Returns two bytes, little-endian, as -32768 to 32767.
  int signed_word() noexcept {
    const unsigned low = byte(), high = byte();
    return static_cast<std::int16_t>(low | (high << 8));
  }
  /// Fills `out` with the next bytes.
  void fill(std::span<std::uint8_t> out) noexcept {
    for (std::uint8_t& b : out) b = byte();
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Prints the requirement and aborts if the condition is false; the fuzzer stores the input as a finding.
inline void require(bool condition, const char* requirement) {
  if (condition) return;
  std::fprintf(stderr, "violated: %s\n", requirement);
  std::abort();
}

}  // namespace wrenchd::test
