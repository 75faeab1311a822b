// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/min_max_history.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

void MinMaxHistory::add(std::int64_t time_ns, const ChannelValues& values) {
  if (started_ && time_ns < current_.begin_ns) {
    first_ = end_index();
    complete_.clear();
    started_ = false;
  }
  if (started_ && time_ns >= current_.begin_ns + bucket_ns_) {
    complete_.push_back(current_);
    if (complete_.size() > capacity_) {
      complete_.pop_front();
      ++first_;
    }
    started_ = false;
  }
  if (!started_) {
    current_ = {time_ns - time_ns % bucket_ns_, values, values};
    started_ = true;
    return;
  }
  // Fmin and fmax ignore NaN if the other value is a number.
  for (std::size_t i = 0; i < kChannelCount; ++i) {
    current_.min[i] = std::fmin(current_.min[i], values[i]);
    current_.max[i] = std::fmax(current_.max[i], values[i]);
  }
}

std::uint64_t MinMaxHistory::index_at(std::int64_t time_ns) const {
  const auto found =
      std::lower_bound(complete_.begin(), complete_.end(), time_ns,
                       [](const Bucket& stretch, std::int64_t t) { return stretch.begin_ns < t; });
  return first_ + static_cast<std::uint64_t>(found - complete_.begin());
}

}  // namespace wrenchd
