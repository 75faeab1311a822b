// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/loop_timing.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace wrenchd {

// Below 32 ns each nanosecond has a bucket. Above, the five bits after the leading bit select the bucket
// within the octave.
std::size_t DurationHistogram::bucket_of(std::uint64_t ns) noexcept {
  if (ns < kBucketsPerOctave) return ns;
  const unsigned shift = static_cast<unsigned>(std::bit_width(ns)) - 1 - kBucketBits;
  const std::size_t bucket = (shift + 1) * kBucketsPerOctave + ((ns >> shift) - kBucketsPerOctave);
  return std::min(bucket, kBucketsPerOctave * kOctaves - 1);
}

std::uint64_t DurationHistogram::upper_end_ns(std::size_t bucket) noexcept {
  if (bucket < kBucketsPerOctave) return bucket;
  const std::size_t shift = bucket / kBucketsPerOctave - 1;
  return ((bucket % kBucketsPerOctave + kBucketsPerOctave + 1) << shift) - 1;
}

void DurationHistogram::add(Duration duration) noexcept {
  const std::int64_t ns = std::max<std::int64_t>(duration.count(), 0);
  buckets_[bucket_of(static_cast<std::uint64_t>(ns))].fetch_add(1, std::memory_order_relaxed);
  count_.fetch_add(1, std::memory_order_relaxed);
  if (ns > max_ns_.load(std::memory_order_relaxed)) max_ns_.store(ns, std::memory_order_relaxed);
}

Duration DurationHistogram::quantile(double fraction) const noexcept {
  const std::uint64_t total = count();
  const auto target = static_cast<std::uint64_t>(std::ceil(fraction * static_cast<double>(total)));
  std::uint64_t counted = 0;
  for (std::size_t b = 0; b < buckets_.size(); ++b) {
    counted += buckets_[b].load(std::memory_order_relaxed);
    if (counted >= target && counted > 0)
      return std::min(Duration(static_cast<std::int64_t>(upper_end_ns(b))), max());
  }
  return max();
}

const char* name(Stage stage) noexcept {
  switch (stage) {
    case Stage::read:
      return "read";
    case Stage::projection:
      return "projection";
    case Stage::wrench:
      return "wrench";
    case Stage::limits:
      return "limits";
    case Stage::write:
      return "write";
  }
  return "unknown";
}

}  // namespace wrenchd
