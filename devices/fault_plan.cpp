// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/fault_plan.hpp"

#include <algorithm>

namespace wrenchd {

bool FaultPlan::shows(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept {
  return std::any_of(faults_.begin(), faults_.end(), [&](const SimulatedFault& fault) {
    const TimePoint start = power_on_ + fault.start;
    return fault.kind == kind && start <= to && from < start + fault.duration;
  });
}

}  // namespace wrenchd
