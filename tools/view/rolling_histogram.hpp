// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace wrenchd {

/// Histogram of durations over the last ten seconds with logarithmic bins from 1 us to 100 ms. The first and
/// the last bin also contain shorter and longer durations. Not thread-safe. Not RT-safe: summary() takes some
/// 10 us.
class RollingHistogram {
 public:
  static constexpr std::size_t kBinsPerDecade = 12;  ///< resolution of the drawn histogram
  static constexpr std::size_t kDecades = 5;
  static constexpr std::size_t kBins = kBinsPerDecade * kDecades;
  static constexpr std::int64_t kWindow_s = 10;

  void add(std::int64_t time_ns, std::int64_t took_ns);

  struct Summary {
    std::array<std::uint64_t, kBins> bins{};
    std::uint64_t count = 0;
    double p50_us = 0.0,
           /// Upper edges of bins that are 2.4 % wide, clamped to max_us: never below the true quantile.
        p99_9_us = 0.0;
    double max_us = 0.0;
  };
  /// Returns the statistics of the ten seconds before the newest time.
  Summary summary() const;

  /// Returns the lower edge of a bin [us].
  static double lower_edge_us(std::size_t bin);

 private:
  static constexpr std::size_t kSubBins = 8;  ///< fine bins per drawn bin
  struct Second {
    std::int64_t number = -1;
    std::array<std::uint32_t, kBins * kSubBins> bins{};
    std::int64_t max_ns = 0;
  };
  std::array<Second, kWindow_s> seconds_{};
  std::int64_t newest_second_ = -1;
};

}  // namespace wrenchd
