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

/// What a running daemon shows: its ticks through shared memory, its events and its status as they come, and
/// its scene. Connects by itself, again and again. Two threads of its own, one for the ticks and one for the
/// scene, which may take seconds to be made ready; whoever asks never waits for either for long.
class LiveFeed {
 public:
  static constexpr std::int64_t kBucket_ns = 10'000'000;
  static constexpr std::size_t kBuckets = 1'000;  ///< ten seconds

  /// socket: as Client has it.
  explicit LiveFeed(std::string socket);
  ~LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  /// Whether anybody looks; else the ticks are taken in larger portions.
  void set_watched(bool by_anybody) noexcept { watched_.store(by_anybody); }

  /// What there is now. Any thread.
  struct Link {
    bool connected = false;
    std::string error;             ///< it is not
    std::uint64_t connection = 0;  ///< one more with each connection
    double rate_Hz = 0.0;
    Json status;                 ///< as the daemon told it last; null before
    std::uint64_t revision = 0;  ///< one more whenever status or why is another
  };
  Link link() const;
  /// The newest tick. Nothing where there was none yet.
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
  /// With the lock held for so long.
  void with_history(const std::function<void(const MinMaxHistory&)>& look) const;
  /// Events since the last call, oldest first: their JSON.
  std::vector<std::string> events();
  std::string state() const;  ///< of the newest tick

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
  std::atomic<std::uint32_t> reloads_{0};     ///< that were told
  std::atomic<std::uint64_t> connection_{0};  ///< 0: none

  mutable std::mutex mutex_;  ///< of what follows
  Link link_;
  std::optional<Sample> newest_sample_;
  MinMaxHistory history_{kBucket_ns, kBuckets};
  RollingHistogram tick_duration_, wake_latency_;
  std::vector<std::string> events_;
  std::shared_ptr<const ViewScene> scene_;
  std::string scene_error_;

  std::jthread reader_thread_, scene_thread_;  ///< last: they use all of the above
};

}  // namespace wrenchd
