// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <wrenchd/client.hpp>

namespace wrenchd {

/// Sends the pages' requests to the daemon with the rights of the user of this program. A page that arms
/// holds the lease as long as it sends heartbeats. If the page is closed, hidden or unresponsive, the lease
/// is released and the force fades out. Own threads wait for the daemon; the methods do not. Not RT-safe:
/// locks a mutex.
class PageLease {
 public:
  /// A page without a heartbeat for this time loses the lease.
  static constexpr auto kPageTimeout = std::chrono::milliseconds(1000);

  enum class Request : std::uint8_t { arm, disarm, stop, acknowledge };

  /// The result of a request, or the loss of the lease. The callback runs on a thread of this object.
  struct Reply {
    std::uint64_t page = 0;
    std::string request;  ///< "arm", "disarm", "stop", "acknowledge" or "lease"
    bool accepted = false;
    std::string error;  ///< reason for the rejection, as text for the user
  };

  PageLease(std::string socket, std::function<void(const Reply&)> tell);
  /// Releases the lease, which disarms the loop.
  ~PageLease();
  PageLease(const PageLease&) = delete;
  PageLease& operator=(const PageLease&) = delete;

  /// Queues a request and returns immediately. page: unique number of the page. Thread-safe.
  void submit(std::uint64_t page, Request request);
  /// Records that the page is visible and running. Thread-safe.
  void heartbeat(std::uint64_t page) noexcept;
  void page_closed(std::uint64_t page);
  /// Returns the page that holds the lease; 0: none. Thread-safe.
  std::uint64_t holder() const noexcept { return holder_.load(); }
  /// Sets the loop state of the newest tick. If the daemon has disarmed the loop, the lease is released.
  void set_loop_state(const std::string& state);

 private:
  struct PendingRequest {
    std::uint64_t page;
    Request request;
  };
  void run(const std::stop_token& stop);
  void run_stops(const std::stop_token& stop);
  void execute(const PendingRequest& asked);
  void arm(std::uint64_t page);
  void release(const std::string& why);
  Client& client();

  std::string socket_;
  std::function<void(const Reply&)> on_reply_;
  std::atomic<std::uint64_t> holder_{0};
  std::atomic<std::int64_t> last_heartbeat_ns_{0};  ///< time of the last heartbeat on the steady clock
  /// True if the daemon has disarmed the loop while the lease was held.
  std::atomic<bool> disarmed_by_daemon_{false};

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<PendingRequest> pending_;
  /// Pages that request a stop; a separate queue, so that a stop never waits.
  std::deque<std::uint64_t> pending_stops_;
  bool holder_closed_ = false;

  std::optional<Client> client_;  ///< used only by thread_
  std::chrono::steady_clock::time_point armed_at_{};
  std::jthread thread_, stop_thread_;  ///< declared last, because the threads use all members above
};

}  // namespace wrenchd
