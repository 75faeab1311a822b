// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/min_max_columns.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

MinMaxColumns::MinMaxColumns(std::int64_t from_ns, std::int64_t to_ns, std::size_t count)
    : from_ns_(from_ns), to_ns_(std::max(from_ns, to_ns)) {
  // One column less, because the range may begin and end within a column.
  const auto full = static_cast<std::int64_t>(std::max<std::size_t>(count, 2) - 1);
  width_ns_ = (to_ns_ - from_ns_) / full + 1;
}

void MinMaxColumns::add(const MinMaxHistory::Bucket& bucket) {
  if (bucket.begin_ns < from_ns_ || bucket.begin_ns > to_ns_) return;
  const std::int64_t number = bucket.begin_ns / width_ns_;
  if (columns_.empty() || number != last_) {
    columns_.push_back(bucket);
    last_ = number;
    return;
  }
  // Fmin and fmax ignore NaN if the other value is a number.
  MinMaxHistory::Bucket& column = columns_.back();
  for (std::size_t i = 0; i < kChannelCount; ++i) {
    column.min[i] = std::fmin(column.min[i], bucket.min[i]);
    column.max[i] = std::fmax(column.max[i], bucket.max[i]);
  }
}

}  // namespace wrenchd
