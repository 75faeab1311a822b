// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/fault_repeats.hpp"

#include <cstddef>
#include <utility>

namespace wrenchd {

std::optional<std::uint64_t> FaultRepeats::admit(Fault fault, TimePoint at) {
  Row& row = rows_[static_cast<std::size_t>(fault)];
  if (row.admitted_at && at - *row.admitted_at < kInterval) {
    ++row.held_back;
    return {};
  }
  row.admitted_at = at;
  return std::exchange(row.held_back, 0);
}

std::vector<FaultRepeats::HeldBack> FaultRepeats::take() {
  std::vector<HeldBack> taken;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i].held_back > 0) taken.push_back({static_cast<Fault>(i), rows_[i].held_back});
    rows_[i] = {};
  }
  return taken;
}

}  // namespace wrenchd
