// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "devices/report_frame.hpp"

namespace wrenchd {

/// Separates reports in a byte stream of a serial chip, whose packets may hold two reports or a part of one.
/// Skips bytes that do not belong to a report. All members are RT-safe.
class StreamFramer {
 public:
  /// Format of a report: its length, at most kMaxReportBytes, and its first and last byte.
  struct Frame {
    std::size_t length = 0;  ///< 0: each packet is a report, no framing
    std::uint8_t first = 0;
    std::uint8_t last = 0;
  };

  explicit StreamFramer(const Frame& frame) : frame_(frame) {}

  /// Appends bytes and calls `report` with each completed report. RT-safe.
  template <class Report>
  void feed(std::span<const std::uint8_t> bytes, Report&& report) noexcept {
    for (const std::uint8_t byte : bytes) {
      buffer_[size_++] = byte;
      while (size_ > 0 && buffer_[0] != frame_.first) discard(1);
      if (size_ < frame_.length) continue;
      if (buffer_[frame_.length - 1] != frame_.last) {
        do discard(1);
        while (size_ > 0 && buffer_[0] != frame_.first);
        continue;
      }
      report(std::span<const std::uint8_t>(buffer_).first(frame_.length));
      size_ = 0;
    }
  }

 private:
  void discard(std::size_t n) noexcept {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(n),
              buffer_.begin() + static_cast<std::ptrdiff_t>(size_), buffer_.begin());
    size_ -= n;
  }

  Frame frame_;
  std::array<std::uint8_t, kMaxReportBytes> buffer_{};
  std::size_t size_ = 0;
};

}  // namespace wrenchd
