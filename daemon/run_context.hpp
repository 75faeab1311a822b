// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <string>

#include "core/fault.hpp"
#include "daemon/options.hpp"
#include "daemon/process_signals.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/stop_deadline.hpp"

namespace wrenchd {

class ServoLoop;
class TwoHandThread;

/// Exit codes of the process beside 0.
inline constexpr int kExitRejected =
    1;  ///< a file, a device or the kernel rejected the configuration; the loop did not start
inline constexpr int kExitFault = 3;  ///< the run ended with a fault that no client acknowledged

/// Returns the exit code for the fault that ended the run; Fault::none: no fault.
constexpr int exit_code(Fault fault) noexcept {
  return fault == Fault::none ? 0 : kExitFault;
}

/// What the runs of two hands share.
struct TwoHandRun {
  TwoHandThread& thread;               ///< ticks both loops
  std::atomic<bool> failed{false};     ///< a hand ended with an exception: the other one must end too
  std::atomic<bool> faulty{false};     ///< a hand ended with a fault
  std::atomic<int> running_hands = 2;  ///< runs that have not ended
};

/// What every part of a run needs from the process. All members outlive the run.
struct RunContext {
  const Options& options;
  const ProcessSignals& signals;
  ServiceNotify& service;
  StopDeadline& deadline;
  std::size_t hand = 0;             ///< 0: the first hand, or the only one; 1: the second hand
  TwoHandRun* two_hands = nullptr;  ///< null: the loop of this hand has a thread of its own

  /// Returns true if the run must end: a signal, or an error of the other hand.
  bool stop_requested() const noexcept;
  /// Starts the time after which the process ends by force, when the last hand has ended. fault: of this
  /// hand.
  void start_deadline(Fault fault) const noexcept;
};

/// Time between two samples of the live view, two checks of the real-time state and two pumps of the
/// recorder.
inline constexpr auto kSamplePeriod = std::chrono::milliseconds(100);

/// Returns the fault that latched the loop; Fault::none in every other state.
Fault latched_fault(const ServoLoop& loop);

}  // namespace wrenchd
