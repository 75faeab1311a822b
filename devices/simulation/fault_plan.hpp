// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/clock.hpp"
#include "core/simulated_fault.hpp"

namespace wrenchd {

/// Scheduled faults of an emulated device. Faults may overlap.
class FaultPlan {
 public:
  /// Adds a fault. Not RT-safe: allocates.
  void add(const SimulatedFault& fault) { faults_.push_back(fault); }
  /// Sets the time from which the start times of the faults count. RT-safe.
  void power_on(TimePoint now) noexcept { power_on_ = now; }
  /// Returns true if a fault of this kind is active at any time in from..to. RT-safe.
  bool active_during(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept {
    return find(kind, from, to) != nullptr;
  }
  /// Returns the first active fault of this kind; null if there is none. RT-safe.
  const SimulatedFault* active_at(SimulatedFault::Kind kind, TimePoint now) const noexcept {
    return find(kind, now, now);
  }
  /// Return the start time and the end time of a fault. RT-safe.
  TimePoint start_of(const SimulatedFault& fault) const noexcept { return power_on_ + fault.start; }
  TimePoint end_of(const SimulatedFault& fault) const noexcept { return start_of(fault) + fault.duration; }

 private:
  const SimulatedFault* find(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept;

  std::vector<SimulatedFault> faults_;
  TimePoint power_on_{};
};

}  // namespace wrenchd
