// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace wrenchd {

/// Hands the newest value of one writer to one reader. Neither ever waits: three slots go round, one being
/// written, one being read, one in between. What the reader has not taken by the next write is lost, which is
/// what "latest" means. RT safe on both sides, for a T that copies without allocating.
template <class T>
class LatestValue {
 public:
  /// By the writer only.
  void write(const T& value) noexcept {
    slots_[writing_] = value;
    writing_ =
        middle_.exchange(static_cast<std::uint8_t>(writing_ | kNew), std::memory_order_acq_rel) & kIndex;
  }

  /// By the reader only: takes the newest value, if there is one that was not taken yet.
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
  std::uint8_t writing_ = 0;  ///< belongs to the writer
  std::uint8_t reading_ = 1;  ///< belongs to the reader
  std::atomic<std::uint8_t> middle_{2};
};

}  // namespace wrenchd
