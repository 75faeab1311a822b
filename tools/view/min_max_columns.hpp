// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tools/view/min_max_history.hpp"

namespace wrenchd {

/// Minimum and maximum of each channel in columns of equal width, for a plot that has fewer pixels than the
/// range has ticks. A peak in a single tick stays visible. Columns begin at multiples of their width, so that
/// a curve does not flicker while the range moves. A column without values is left out. Not RT-safe:
/// allocates.
class MinMaxColumns {
 public:
  /// Prepares at most `count` columns for times from from_ns to to_ns, both included. count: at least 2.
  MinMaxColumns(std::int64_t from_ns, std::int64_t to_ns, std::size_t count);

  /// Adds a bucket or, with equal minimum and maximum, a tick. Times must not decrease. Ignores times outside
  /// of the range.
  void add(const MinMaxHistory::Bucket& bucket);

  std::int64_t from_ns() const noexcept { return from_ns_; }
  std::int64_t to_ns() const noexcept { return to_ns_; }
  /// Returns the columns. begin_ns of a column is the time of the first bucket in it.
  const std::vector<MinMaxHistory::Bucket>& columns() const noexcept { return columns_; }

 private:
  std::int64_t from_ns_, to_ns_, width_ns_;
  std::int64_t last_ = 0;  ///< number of the last column, counted from the origin of the clock
  std::vector<MinMaxHistory::Bucket> columns_;
};

}  // namespace wrenchd
