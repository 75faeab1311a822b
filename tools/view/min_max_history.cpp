// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/min_max_history.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

void Extremes::add(std::int64_t time_ns, const ChannelValues& values) {
  if (begun_ && time_ns < growing_.begin_ns) {
    first_ = end();
    whole_.clear();
    begun_ = false;
  }
  if (begun_ && time_ns >= growing_.begin_ns + stretch_ns_) {
    whole_.push_back(growing_);
    if (whole_.size() > kept_) {
      whole_.pop_front();
      ++first_;
    }
    begun_ = false;
  }
  if (!begun_) {
    growing_ = {time_ns - time_ns % stretch_ns_, values, values};
    begun_ = true;
    return;
  }
  for (std::size_t i = 0; i < kChannels; ++i) {  // fmin and fmax take the number where one of two is NaN
    growing_.least[i] = std::fmin(growing_.least[i], values[i]);
    growing_.most[i] = std::fmax(growing_.most[i], values[i]);
  }
}

std::uint64_t Extremes::from(std::int64_t time_ns) const {
  const auto found =
      std::lower_bound(whole_.begin(), whole_.end(), time_ns,
                       [](const Stretch& stretch, std::int64_t t) { return stretch.begin_ns < t; });
  return first_ + static_cast<std::uint64_t>(found - whole_.begin());
}

}  // namespace wrenchd
