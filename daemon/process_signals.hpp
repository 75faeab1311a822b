// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

namespace wrenchd {

class ServoLoop;

/// Installs the signal handlers and the terminate handler of the process. Create one object, in main(),
/// before other threads start. Afterwards no signal ends the process before the hand is released, except
/// SIGKILL:
///
///   SIGINT, SIGTERM, SIGQUIT, SIGPWR      end the run
///   SIGALRM, SIGVTALRM, SIGPROF, SIGIO,   end the run: nobody sends them to wrenchd by design
///   SIGSTKFLT, real-time signals
///   SIGHUP                                reads the configuration again
///   SIGUSR1                               emergency stop
///   SIGUSR2                               acknowledges a stop or a fault
///   SIGPIPE, SIGXFSZ                      ignored: the write fails, and its caller reports the error
///   SIGTSTP, SIGTTIN, SIGTTOU             ignored: a suspended process cannot release the hand
///   SIGSEGV, SIGBUS, SIGILL, SIGFPE,      release the hand, then end the process as without a handler
///   SIGSYS, SIGTRAP, SIGABRT, SIGXCPU
///
/// std::terminate() releases the hand, writes the reason to standard error and aborts. All functions may be
/// called from any thread.
class ProcessSignals {
 public:
  ProcessSignals();
  ProcessSignals(const ProcessSignals&) = delete;
  ProcessSignals& operator=(const ProcessSignals&) = delete;

  /// Returns true after a signal that ends the run.
  bool stop_requested() const noexcept;
  /// Returns true once after each SIGHUP, and clears that request.
  bool take_reload_request() const noexcept;
};

/// Connects the signal handlers to a servo loop while this object lives: one object for each hand, at most
/// kMaxTargets at a time.
///
/// The destructor waits until no handler uses the loop any more, so a handler never uses a destroyed loop.
class SignalTarget {
 public:
  static constexpr std::size_t kMaxTargets = 2;

  explicit SignalTarget(ServoLoop& loop) noexcept;
  ~SignalTarget();
  SignalTarget(const SignalTarget&) = delete;
  SignalTarget& operator=(const SignalTarget&) = delete;

 private:
  ServoLoop& loop_;
};

/// While this object lives, the calling thread ticks the loops of the signal targets. A crash on this thread
/// releases the hand directly; a crash on any other thread asks this thread to release it, because a release
/// must not run beside a tick.
class ServoThreadMark {
 public:
  ServoThreadMark() noexcept;
  ~ServoThreadMark();
  ServoThreadMark(const ServoThreadMark&) = delete;
  ServoThreadMark& operator=(const ServoThreadMark&) = delete;
};

/// Releases the hand because the process ends without the end of its run. Returns when the zero wrench is
/// written, after 0.1 s at most. Does nothing if there is no signal target. Any thread. Async-signal-safe.
void release_hand_before_exit() noexcept;

}  // namespace wrenchd
