// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {

/// What the service manager wants to know of a servo loop, at one moment.
struct LoopStatus {
  State state = State::disconnected;
  Fault cause = Fault::none;  ///< that led to it
  std::uint64_t ticks = 0;    ///< since it was made
};

/// One line for a person who asks the service manager: the state, the device, and where a fault led to the
/// state its sentence and its cure.
std::string status_text(const LoopStatus& loop, const std::string& device);

/// What the service manager is to be told, look after look: assignments as sd_notify(3) has them. No I/O, no
/// clock.
///
/// READY=1 comes once: when the loop's first self-test is over, however it ended, or when the daemon waits
/// for a device or for a person, which may take for ever. WATCHDOG=1 comes with every look at which nothing
/// runs that could stand still; where a loop runs only if it has ticked since the look before.
class ServiceReport {
 public:
  /// No loop runs from now on: why, in words.
  void waiting(std::string why);
  /// A loop runs, on this device.
  void running(std::string device);
  /// It is the end: no loop, nothing to wait for.
  void stopping(std::string words);
  /// A new configuration is being read; `monotonic_us` is now. Nothing else changes.
  void reloading(std::uint64_t monotonic_us);
  /// That is over, whatever came of it.
  void reloaded();

  /// What to say now; empty: nothing. `loop`: where one runs.
  std::string next_message(const std::optional<LoopStatus>& loop);

 private:
  enum class Phase : std::uint8_t { starting, waiting, running, stopping };
  Phase phase_ = Phase::starting;
  std::string detail_;       ///< why it waits, the device, or how it ends
  std::string last_status_;  ///< the last status
  std::string pending_;      ///< to be said with the next look
  bool ready_sent_ = false;
  std::optional<std::uint64_t> last_ticks_;  ///< at the look before
};

/// Tells the service manager (systemd, by the socket in $NOTIFY_SOCKET) how the daemon is, from a thread of
/// its own. Where nobody asked to be told it does nothing. All of its functions may be called from any thread
/// but the servo thread; they wait for one look at most.
class ServiceNotify {
 public:
  using ReadLoopStatus = std::function<LoopStatus()>;

  ServiceNotify();
  /// The last words are out when it returns.
  ~ServiceNotify();
  ServiceNotify(const ServiceNotify&) = delete;
  ServiceNotify& operator=(const ServiceNotify&) = delete;

  void waiting(const std::string& why);
  /// `loop` is called from the thread until waiting(), loop_ended() or stopping() is.
  void running(ReadLoopStatus loop, const std::string& device);
  void loop_ended() noexcept;
  void stopping(const std::string& words);
  void reloading();
  void reloaded();

 private:
  void update(const std::function<void()>& change);
  void send_report();

  const bool enabled_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  ServiceReport report_;
  ReadLoopStatus read_loop_status_;
  std::jthread thread_;  ///< last: it uses all of the above
};

}  // namespace wrenchd
