// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>

namespace wrenchd {

/// The quantities that the page draws over time.
enum class Channel : std::uint8_t {
  force_x,  ///< as sent to the device [N]
  force_y,
  force_z,
  force,     ///< magnitude of the force [N]
  torque_x,  ///< as sent to the device [N.m]
  torque_y,
  torque_z,
  torque,
  energy,  ///< T of Eq. (8) [kg m^2]
  depth,   ///< distance from p to q [m]
  angle,   ///< angle from p to q [rad]
};
inline constexpr std::size_t kChannelCount = 11;
using ChannelValues = std::array<double, kChannelCount>;

/// Curves for a screen: minimum and maximum of each channel per time bucket, so that a peak in a single tick
/// stays visible at any zoom. NaN if a bucket has no value. Not RT-safe: allocates.
class MinMaxHistory {
 public:
  struct Bucket {
    std::int64_t begin_ns = 0;
    ChannelValues min, max;
  };

  /// kept: maximum number of buckets; older ones are dropped.
  explicit MinMaxHistory(std::int64_t stretch_ns, std::size_t kept = std::numeric_limits<std::size_t>::max())
      : bucket_ns_(stretch_ns), capacity_(kept) {}

  /// Adds the values of one tick. Times must not decrease; if one does, for example after a restart of the
  /// daemon, the history is cleared.
  void add(std::int64_t time_ns, const ChannelValues& values);

  /// Returns the index range of the complete buckets; the current bucket is not in it. Indices are never
  /// reused.
  std::uint64_t first_index() const noexcept { return first_; }
  std::uint64_t end_index() const noexcept { return first_ + complete_.size(); }
  const Bucket& at(std::uint64_t number) const {
    return complete_[static_cast<std::size_t>(number - first_)];
  }
  /// Returns the index of the first bucket that begins at this time or later.
  std::uint64_t index_at(std::int64_t time_ns) const;

 private:
  std::int64_t bucket_ns_;
  std::size_t capacity_;
  std::uint64_t first_ = 0;
  std::deque<Bucket> complete_;
  Bucket current_;
  bool started_ = false;
};

}  // namespace wrenchd
