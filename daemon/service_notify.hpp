// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {

/// State of a servo loop, as the service manager needs it.
struct LoopStatus {
  State state = State::disconnected;
  Fault cause = Fault::none;  ///< fault that led to the state
  std::uint64_t ticks = 0;    ///< ticks since the loop was created
};

/// Returns one line for `systemctl status`: state, device, and if a fault led to the state its message and
/// cure. Not RT-safe: allocates.
std::string status_text(const LoopStatus& loop, const std::string& device);

/// Builds the messages to the service manager: assignments in the format of sd_notify(3). Does no I/O and
/// reads no clock. Not RT-safe: allocates.
///
/// READY=1 is sent once: when the first self-test of the loop ends, or when the daemon waits for a device or
/// a person. WATCHDOG=1 is in every message while no loop runs. While a loop runs, WATCHDOG=1 is in a message
/// only if the loop has ticked since the previous message. With two hands both must be ready and both loops
/// must have ticked.
class ServiceReport {
 public:
  /// The process has a second hand of this name.
  void add_second_hand(std::string name);
  /// No loop of this hand runs from now on; `reason` is for people.
  void waiting(std::string reason, std::size_t hand = 0);
  /// A loop of this hand runs on this device from now on.
  void running(std::string device, std::size_t hand = 0);
  /// The daemon ends; `reason` is for people.
  void stopping(std::string reason);
  /// The daemon reads its configuration again. monotonic_us: current time.
  void reloading(std::uint64_t monotonic_us);
  /// The reload has ended, with or without an error.
  void reloaded();

  /// Returns the next message; empty: nothing to send. loop, second: states of the running loops, if there
  /// are any.
  std::string next_message(const std::optional<LoopStatus>& loop,
                           const std::optional<LoopStatus>& second = {});

 private:
  enum class Phase : std::uint8_t { starting, waiting, running };
  struct Hand {
    std::string name;  ///< empty: the first hand
    Phase phase = Phase::starting;
    std::string detail;                       ///< reason of waiting; device while running
    std::optional<std::uint64_t> last_ticks;  ///< tick count at the previous message
  };
  /// What one hand contributes to a message.
  struct Part {
    std::string status;  ///< empty: no news
    bool ready;
    bool alive;
  };
  Part part_of(Hand& hand, const std::optional<LoopStatus>& loop) const;
  Part part_of_all(const std::optional<LoopStatus>& loop, const std::optional<LoopStatus>& second);

  std::vector<Hand> hands_{1};
  std::string stop_reason_;  ///< empty: the daemon does not end
  std::string last_status_;  ///< last STATUS= that was sent
  std::string pending_;      ///< assignments for the next message
  bool ready_sent_ = false;  ///< READY=1 was sent
};

/// Sends the state of the daemon to the service manager (systemd, by the socket in $NOTIFY_SOCKET) from a
/// thread of its own. Does nothing if $NOTIFY_SOCKET is not set. Any thread except the servo thread may call
/// its functions. Not RT-safe: each function waits for at most one message.
class ServiceNotify {
 public:
  using ReadLoopStatus = std::function<LoopStatus()>;

  ServiceNotify();
  /// Returns after the last message is sent.
  ~ServiceNotify();
  ServiceNotify(const ServiceNotify&) = delete;
  ServiceNotify& operator=(const ServiceNotify&) = delete;

  void add_second_hand(const std::string& name);
  void waiting(const std::string& reason, std::size_t hand = 0);
  /// The thread calls `loop` until waiting() or loop_ended() is called for this hand, or stopping().
  void running(ReadLoopStatus loop, const std::string& device, std::size_t hand = 0);
  void loop_ended(std::size_t hand = 0) noexcept;
  void stopping(const std::string& reason);
  void reloading();
  void reloaded();

 private:
  void update(const std::function<void()>& change);
  void send_report();

  const bool enabled_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  ServiceReport report_;
  std::array<ReadLoopStatus, 2> read_loop_status_;  ///< null: no loop of this hand runs
  std::jthread thread_;                             ///< last member: it uses the members above
};

}  // namespace wrenchd
