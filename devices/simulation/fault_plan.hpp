// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/clock.hpp"
#include "core/simulated_fault.hpp"

namespace wrenchd {

/// What shall go wrong, and when. Any number of faults may overlap.
class FaultPlan {
 public:
  /// Not RT safe.
  void add(const SimulatedFault& fault) { faults_.push_back(fault); }
  /// From here times count. RT safe.
  void power_on(TimePoint now) noexcept { power_on_ = now; }
  /// Whether a fault of this kind shows at any moment from..to. RT safe.
  bool active_during(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept {
    return find(kind, from, to) != nullptr;
  }
  /// The first fault of this kind that shows now; null where there is none. RT safe.
  const SimulatedFault* active_at(SimulatedFault::Kind kind, TimePoint now) const noexcept {
    return find(kind, now, now);
  }
  /// When a fault began, and when it is over.
  TimePoint start_of(const SimulatedFault& fault) const noexcept { return power_on_ + fault.start; }
  TimePoint end_of(const SimulatedFault& fault) const noexcept { return start_of(fault) + fault.duration; }

 private:
  const SimulatedFault* find(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept;

  std::vector<SimulatedFault> faults_;
  TimePoint power_on_{};
};

}  // namespace wrenchd
