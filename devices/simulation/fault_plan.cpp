// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/fault_plan.hpp"

#include <algorithm>

namespace wrenchd {

const SimulatedFault* FaultPlan::find(SimulatedFault::Kind kind, TimePoint from,
                                      TimePoint to) const noexcept {
  const auto found = std::find_if(faults_.begin(), faults_.end(), [&](const SimulatedFault& fault) {
    return fault.kind == kind && start_of(fault) <= to && from < end_of(fault);
  });
  return found == faults_.end() ? nullptr : &*found;
}

}  // namespace wrenchd
