// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "core/clock.hpp"

namespace wrenchd {

/// Histogram of durations with 32 buckets per octave. Quantiles are accurate to 3 %, the maximum is exact.
/// One thread adds, any thread reads, without locks. All members are RT-safe.
class DurationHistogram {
 public:
  /// Counts one duration. Negative durations count as 0.
  void add(Duration duration) noexcept;
  /// Returns the duration that a `fraction` (0 to 1) of all durations does not exceed: the upper end of its
  /// bucket. Returns 0 if the histogram is empty.
  Duration quantile(double fraction) const noexcept;
  Duration max() const noexcept { return Duration(max_ns_.load(std::memory_order_relaxed)); }
  std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }

 private:
  static constexpr unsigned kBucketBits = 5;
  static constexpr std::size_t kBucketsPerOctave = std::size_t{1} << kBucketBits;
  static constexpr std::size_t kOctaves = 36;  ///< The last bucket begins above 15 minutes.
  static std::size_t bucket_of(std::uint64_t ns) noexcept;
  static std::uint64_t upper_end_ns(std::size_t bucket) noexcept;

  std::array<std::atomic<std::uint64_t>, kBucketsPerOctave * kOctaves> buckets_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::int64_t> max_ns_{0};
};

/// The timed stages of a tick, in the order in which servo_loop.cpp calls them.
enum class Stage : std::uint8_t { read, projection, wrench, limits, write };
inline constexpr std::size_t kStageCount = 5;
/// Returns "read", "projection", "wrench", "limits" or "write". RT-safe.
const char* name(Stage stage) noexcept;

/// Durations of the loop and its stages. The servo thread writes, any thread reads. All members are RT-safe.
struct LoopTiming {
  DurationHistogram wake_latency;  ///< Time from the due time of a tick to its start.
  DurationHistogram tick;          ///< Time from the start of a tick to the end of its last stage.
  std::array<DurationHistogram, kStageCount> stage;
  std::atomic<std::uint64_t> overruns{0};       ///< Ticks that ended after the next tick was due.
  std::atomic<std::uint64_t> skipped_ticks{0};  ///< Ticks that the loop skipped because of overruns.
};

}  // namespace wrenchd
