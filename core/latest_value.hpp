// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace wrenchd {

/// Passes the newest value from one writer thread to one reader thread without locks. Three slots rotate: one
/// for the writer, one for the reader, one between them. A value that the reader has not taken before the
/// next write is lost. RT-safe on both sides if T copies without allocation.
template <class T>
class LatestValue {
 public:
  /// Publishes a value. Writer thread only. RT-safe.
  void write(const T& value) noexcept {
    slots_[writing_] = value;
    writing_ =
        middle_.exchange(static_cast<std::uint8_t>(writing_ | kNew), std::memory_order_acq_rel) & kIndex;
  }

  /// Copies the newest value into `value` and returns true; returns false if it has been taken already.
  /// Reader thread only. RT-safe.
  bool read(T& value) noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kNew) == 0) return false;
    reading_ = middle_.exchange(reading_, std::memory_order_acq_rel) & kIndex;
    value = slots_[reading_];
    return true;
  }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kNew = 4;

  std::array<T, 3> slots_{};
  std::uint8_t writing_ = 0;  ///< slot of the writer
  std::uint8_t reading_ = 1;  ///< slot of the reader
  std::atomic<std::uint8_t> middle_{2};
};

}  // namespace wrenchd
