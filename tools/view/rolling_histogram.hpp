// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace wrenchd {

/// How long something took, over the last ten seconds: a histogram whose bins are equally wide in the
/// logarithm, from 1 us to 100 ms. What is shorter or longer is in the first or the last.
class RollingHistogram {
 public:
  static constexpr std::size_t kBinsPerDecade = 12;  ///< as drawn
  static constexpr std::size_t kDecades = 5;
  static constexpr std::size_t kBins = kBinsPerDecade * kDecades;
  static constexpr std::int64_t kWindow_s = 10;

  void add(std::int64_t time_ns, std::int64_t took_ns);

  struct Summary {
    std::array<std::uint64_t, kBins> bins{};
    std::uint64_t count = 0;
    double p50_us = 0.0,
           p99_9_us = 0.0;  ///< upper edges of fine bins, 2.4 % wide: never too low; no more than max_us
    double max_us = 0.0;
  };
  /// Of the ten seconds up to the newest time.
  Summary summary() const;

  /// Lower edge of a bin [us].
  static double lower_edge_us(std::size_t bin);

 private:
  static constexpr std::size_t kSubBins = 8;  ///< in each bin
  struct Second {
    std::int64_t number = -1;
    std::array<std::uint32_t, kBins * kSubBins> bins{};
    std::int64_t max_ns = 0;
  };
  std::array<Second, kWindow_s> seconds_{};
  std::int64_t newest_second_ = -1;
};

}  // namespace wrenchd
