// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "devices/simulation/fault_plan.hpp"

namespace wrenchd {

/// Receives the reports of an emulated device at the time at which it sends them.
class ReportSink {
 public:
  /// Receives a report that the device sent at `sent`. RT-safe.
  virtual void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept = 0;

 protected:
  ~ReportSink() = default;
};

/// Emulated firmware of a device, as far as a host can observe it. It depends only on report bytes, time and
/// the motion of the hand, and not on wrenchd. All members except inject() are RT-safe.
class EmulatedDevice {
 public:
  virtual ~EmulatedDevice() = default;

  /// Advances the device to time t. The first call switches the power on. RT-safe.
  virtual void advance_to(TimePoint t, ReportSink& host) noexcept = 0;
  /// Receives a command report of the host at time `now`. Returns false if the firmware ignores it. RT-safe.
  virtual bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Returns the time of the next event, as far as it is known. RT-safe.
  virtual TimePoint next_event() const noexcept = 0;

  /// Schedules a fault. LoopbackLink applies the transport faults; the device applies faults of the pose.
  /// Throws std::invalid_argument if this kind of device does not support the fault. Not RT-safe: allocates.
  virtual void inject(const SimulatedFault& fault) { faults_.add(fault); }
  /// Returns true if a fault of this kind is active at any time in from..to. RT-safe.
  bool fault_active_during(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept {
    return faults_.active_during(kind, from, to);
  }
  const FaultPlan& faults() const noexcept { return faults_; }

 protected:
  FaultPlan faults_;  ///< the derived class sets the power-on time
};

}  // namespace wrenchd
