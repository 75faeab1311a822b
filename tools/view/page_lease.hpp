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
  static constexpr auto kSilentPage = std::chrono::milliseconds(1000);

  enum class Wish : std::uint8_t { arm, disarm, stop, acknowledge };

  /// What became of a wish, or of the lease. Called on threads of this.
  struct Told {
    std::uint64_t page = 0;
    std::string what;  ///< "arm", ..., "lease"
    bool done = false;
    std::string text;  ///< why not, for people
  };

  PageLease(std::string socket, std::function<void(const Told&)> tell);
  /// Gives back what it has: the hand is released.
  ~PageLease();
  PageLease(const PageLease&) = delete;
  PageLease& operator=(const PageLease&) = delete;

  /// page: a number that no other page ever has. Any thread, at once.
  void ask(std::uint64_t page, Wish wish);
  /// Somebody sees that page.
  void lives(std::uint64_t page) noexcept;
  void gone(std::uint64_t page);
  /// The page that has the lease; 0: none.
  std::uint64_t holder() const noexcept { return holder_.load(); }
  /// State of the loop, as its ticks tell it: a lease under which the daemon has disarmed is given back.
  void loop_is(const std::string& state);

 private:
  struct Asked {
    std::uint64_t page;
    Wish wish;
  };
  void run(const std::stop_token& stop);
  void run_stops(const std::stop_token& stop);
  void fulfil(const Asked& asked);
  void arm(std::uint64_t page);
  void let_go(const std::string& why);
  Client& client();

  std::string socket_;
  std::function<void(const Told&)> tell_;
  std::atomic<std::uint64_t> holder_{0};
  std::atomic<std::int64_t> lived_at_ns_{0};  ///< steady clock
  std::atomic<bool> disarmed_{false};         ///< by the daemon, under the lease

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Asked> asked_;
  std::deque<std::uint64_t> stops_;  ///< pages that ask for a stop: nothing may be in its way
  bool holder_gone_ = false;

  std::optional<Client> client_;  ///< of the thread
  std::chrono::steady_clock::time_point armed_at_{};
  std::jthread thread_, stop_thread_;  ///< last: they use all of the above
};

}  // namespace wrenchd
