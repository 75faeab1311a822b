// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <wrenchd/client.hpp>

#include "daemon/control/json_rpc.hpp"
#include "tools/view/min_max_history.hpp"
#include "tools/view/rolling_histogram.hpp"
#include "tools/view/view_scene.hpp"
#include "tools/view/view_tick.hpp"

namespace wrenchd {

/// The live data of a running daemon: ticks through shared memory, events, status and scene. Reconnects
/// automatically. One thread reads the ticks; another prepares the scene, which may take seconds. The methods
/// never wait long for these threads. Not RT-safe: allocates and locks a mutex.
class LiveFeed {
 public:
  static constexpr std::int64_t kBucket_ns = 10'000'000;
  static constexpr std::size_t kBuckets = 1'000;  ///< 10 s

  /// socket: path of the daemon's socket; empty: default paths as for Client.
  explicit LiveFeed(std::string socket);
  ~LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  /// Sets whether a page is open. Without one, the feed reads ticks less often.
  void set_watched(bool by_anybody) noexcept { watched_.store(by_anybody); }

  /// State of the connection. Thread-safe.
  struct Link {
    bool connected = false;
    std::string error;             ///< reason why there is no connection; empty if there is one
    std::uint64_t connection = 0;  ///< number of the connection, incremented for each new one
    double rate_Hz = 0.0;
    Json status;                 ///< last status from the daemon; null before the first one
    std::uint64_t revision = 0;  ///< incremented when status or error changes
  };
  Link link() const;
  /// The newest tick. newest_sample() is empty before the first tick.
  struct Sample {
    ViewTick tick;
    ViewStatus words;
    std::uint64_t missed = 0;
  };
  std::optional<Sample> newest_sample() const;
  std::shared_ptr<const ViewScene> scene() const;
  std::string scene_error() const;
  RollingHistogram::Summary tick_duration() const;
  RollingHistogram::Summary wake_latency() const;
  /// Calls the function with the history while the mutex is locked.
  void with_history(const std::function<void(const MinMaxHistory&)>& visit) const;
  /// Returns the events since the last call as JSON texts, oldest first.
  std::vector<std::string> events();
  std::string state() const;  ///< loop state of the newest tick

  const std::string& socket() const noexcept { return socket_; }

 private:
  void run_reader(const std::stop_token& stop);
  void read_ticks(Client& client, StateReader& reader, const std::stop_token& stop);
  void request_status(Client& client);
  void set_disconnected(const std::string& why);
  void run_scene_fetcher(const std::stop_token& stop);
  void fetch_scene(Client& client);

  std::string socket_;
  std::atomic<bool> watched_{false};
  std::atomic<std::uint32_t> rendering_id_{0};
  std::atomic<std::uint32_t> reloads_{0};     ///< number of reload events
  std::atomic<std::uint64_t> connection_{0};  ///< number of the connection; 0: none

  mutable std::mutex mutex_;  ///< guards the members below, up to the threads
  Link link_;
  std::optional<Sample> newest_sample_;
  MinMaxHistory history_{kBucket_ns, kBuckets};
  RollingHistogram tick_duration_, wake_latency_;
  std::vector<std::string> events_;
  std::shared_ptr<const ViewScene> scene_;
  std::string scene_error_;

  std::jthread reader_thread_, scene_thread_;  ///< declared last, because the threads use all members above
};

}  // namespace wrenchd
