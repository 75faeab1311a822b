// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "devices/simulation/fault_plan.hpp"

namespace wrenchd {

/// Takes the reports of an emulated device at the moment they leave it.
class ReportSink {
 public:
  /// RT safe.
  virtual void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept = 0;

 protected:
  ~ReportSink() = default;
};

/// The far end of a device's protocol: what its firmware does, as far as a host can see it. It knows no
/// wrenchd: only bytes, time, and what a hand does with it. All but the planning of faults is RT safe.
class EmulatedDevice {
 public:
  virtual ~EmulatedDevice() = default;

  /// Lets time pass, up to t. The first call switches the power on.
  virtual void advance_to(TimePoint t, ReportSink& host) noexcept = 0;
  /// A report of the host arrives, now. False where the firmware ignores it.
  virtual bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept = 0;
  /// When there is something to do next, as far as that is known.
  virtual TimePoint next_event() const noexcept = 0;

  /// Plans a fault. Those of the wire (all but what a pose says) are shown by LoopbackLink. Throws
  /// std::invalid_argument where a device of this kind cannot have it. Not RT safe.
  virtual void inject(const SimulatedFault& fault) { faults_.add(fault); }
  /// Whether a fault of this kind shows at any moment from..to.
  bool fault_active_during(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept {
    return faults_.active_during(kind, from, to);
  }
  const FaultPlan& faults() const noexcept { return faults_; }

 protected:
  FaultPlan faults_;  ///< whoever is switched on tells it when
};

}  // namespace wrenchd
