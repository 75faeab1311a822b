// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "core/clock.hpp"

namespace wrenchd {

/// Counts durations in fixed buckets, 32 to each power of two: any quantile is right within 3 %, the maximum
/// exactly. One thread adds, any thread reads; nobody waits. RT safe.
class DurationHistogram {
 public:
  void add(Duration duration) noexcept;
  /// The duration below which this share (0 to 1) of all lies: the upper end of its bucket. Zero while empty.
  Duration quantile(double share) const noexcept;
  Duration max() const noexcept { return Duration(max_ns_.load(std::memory_order_relaxed)); }
  std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }

 private:
  static constexpr unsigned kBucketBits = 5;
  static constexpr std::size_t kBucketsPerOctave = std::size_t{1} << kBucketBits;
  static constexpr std::size_t kOctaves = 36;  ///< the last bucket starts above a quarter of an hour
  static std::size_t bucket_of(std::uint64_t ns) noexcept;
  static std::uint64_t upper_end_ns(std::size_t bucket) noexcept;

  std::array<std::atomic<std::uint64_t>, kBucketsPerOctave * kOctaves> buckets_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::int64_t> max_ns_{0};
};

/// The stages of a tick, in order, as servo_loop.cpp calls them.
enum class Stage : std::uint8_t { read, projection, wrench, limits, write };
inline constexpr std::size_t kStageCount = 5;
const char* name(Stage stage) noexcept;

/// What the loop's time goes into. One per loop; written by the servo thread, read by anybody.
struct LoopTiming {
  DurationHistogram wake_latency;  ///< from the time a tick was due to its start
  DurationHistogram tick;          ///< from its start to the end of its last stage
  std::array<DurationHistogram, kStageCount> stage;
  std::atomic<std::uint64_t> overruns{0};       ///< ticks that were not over when the next was due
  std::atomic<std::uint64_t> skipped_ticks{0};  ///< ticks left out because of them; they are never caught up
};

}  // namespace wrenchd
