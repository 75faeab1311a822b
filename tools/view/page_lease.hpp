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

/// What pages ask of the daemon, with the rights of whoever runs this program. A page that arms gets the
/// lease, and keeps it for as long as it says that it lives: one that was closed, that hangs, or that nobody
/// sees any more lets go of the hand. Threads of its own; nothing here waits for the daemon but those.
class PageLease {
 public:
  /// A page that has been silent for longer than this is not looked at.
  static constexpr auto kPageTimeout = std::chrono::milliseconds(1000);

  enum class Request : std::uint8_t { arm, disarm, stop, acknowledge };

  /// What became of a wish, or of the lease. Called on threads of this.
  struct Reply {
    std::uint64_t page = 0;
    std::string request;  ///< "arm", ..., "lease"
    bool accepted = false;
    std::string error;  ///< why not, for people
  };

  PageLease(std::string socket, std::function<void(const Reply&)> tell);
  /// Gives back what it has: the hand is released.
  ~PageLease();
  PageLease(const PageLease&) = delete;
  PageLease& operator=(const PageLease&) = delete;

  /// page: a number that no other page ever has. Any thread, at once.
  void submit(std::uint64_t page, Request wish);
  /// Somebody sees that page.
  void heartbeat(std::uint64_t page) noexcept;
  void page_closed(std::uint64_t page);
  /// The page that has the lease; 0: none.
  std::uint64_t holder() const noexcept { return holder_.load(); }
  /// State of the loop, as its ticks tell it: a lease under which the daemon has disarmed is given back.
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
  std::atomic<std::int64_t> last_heartbeat_ns_{0};  ///< steady clock
  std::atomic<bool> disarmed_by_daemon_{false};     ///< by the daemon, under the lease

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<PendingRequest> pending_;
  std::deque<std::uint64_t> pending_stops_;  ///< pages that ask for a stop: nothing may be in its way
  bool holder_closed_ = false;

  std::optional<Client> client_;  ///< of the thread
  std::chrono::steady_clock::time_point armed_at_{};
  std::jthread thread_, stop_thread_;  ///< last: they use all of the above
};

}  // namespace wrenchd
