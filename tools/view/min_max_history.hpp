// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>

namespace wrenchd {

/// What is drawn over time.
enum class Channel : std::uint8_t {
  force_x,  ///< as told to the device [N]
  force_y,
  force_z,
  force,     ///< its magnitude [N]
  torque_x,  ///< likewise [N.m]
  torque_y,
  torque_z,
  torque,
  energy,  ///< T of Eq. (8) [kg m^2]
  depth,   ///< from p to q [m]
  angle,   ///< likewise [rad]
};
inline constexpr std::size_t kChannelCount = 11;
using ChannelValues = std::array<double, kChannelCount>;

/// Curves for a screen: of each short stretch of time the least and the greatest value of each channel, so
/// that a peak of a single tick is drawn however many ticks a pixel has. NaN where a stretch had no value.
class MinMaxHistory {
 public:
  struct Bucket {
    std::int64_t begin_ns = 0;
    ChannelValues min, max;
  };

  /// kept: so many of the newest stretches; older ones are forgotten.
  explicit MinMaxHistory(std::int64_t stretch_ns, std::size_t kept = std::numeric_limits<std::size_t>::max())
      : bucket_ns_(stretch_ns), capacity_(kept) {}

  /// Times never fall; where one does, as after a restart of whoever counts them, all is forgotten.
  void add(std::int64_t time_ns, const ChannelValues& values);

  /// Whole stretches, by their numbers, that are never used again. The one that is still growing is not among
  /// them.
  std::uint64_t first_index() const noexcept { return first_; }
  std::uint64_t end_index() const noexcept { return first_ + complete_.size(); }
  const Bucket& at(std::uint64_t number) const {
    return complete_[static_cast<std::size_t>(number - first_)];
  }
  /// The first stretch that begins at this time or later.
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
