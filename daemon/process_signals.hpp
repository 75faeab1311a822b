// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd {

class ServoLoop;

/// Installs the signal handlers and the terminate handler of the process. Create one object, in main(),
/// before other threads start.
///
///   SIGINT, SIGTERM   end the run
///   SIGHUP            read the configuration again
///   SIGUSR1           emergency stop
///   SIGUSR2           acknowledge a stop or a fault
///
/// std::terminate() releases the hand before the process aborts. All functions may be called from any thread.
class ProcessSignals {
 public:
  ProcessSignals();
  ProcessSignals(const ProcessSignals&) = delete;
  ProcessSignals& operator=(const ProcessSignals&) = delete;

  /// Returns true after SIGINT or SIGTERM.
  bool stop_requested() const noexcept;
  /// Returns true once after each SIGHUP, and clears that request.
  bool take_reload_request() const noexcept;
};

/// Connects the signal handlers to a servo loop while this object lives. At most one object at a time.
///
/// The destructor waits until no handler uses the loop any more, so a handler never uses a destroyed loop.
class SignalTarget {
 public:
  explicit SignalTarget(ServoLoop& loop) noexcept;
  ~SignalTarget();
  SignalTarget(const SignalTarget&) = delete;
  SignalTarget& operator=(const SignalTarget&) = delete;
};

}  // namespace wrenchd
