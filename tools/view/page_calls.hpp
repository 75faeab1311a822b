// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include <wrenchd/client.hpp>

#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Calls methods of the daemon for the page's drawer, with the rights of the user of this program. Calls run
/// one after the other, on a thread of this object, because loading a scene may take seconds; submit() does
/// not wait. Not RT-safe: locks a mutex.
class PageCalls {
 public:
  /// Maximum number of calls that wait; above it a call is rejected.
  static constexpr std::size_t kMaxPending = 32;

  struct Call {
    std::uint64_t page = 0;
    std::uint64_t id = 0;  ///< chosen by the page, which receives it with the reply
    std::string method;
    Json params = Json::object();
  };
  /// Exactly one of the two is set: the result, or the error as text for the user.
  struct Reply {
    std::uint64_t page = 0;
    std::uint64_t id = 0;
    Json result;
    std::string error;
  };

  /// on_reply: runs on the thread of this object, or on that of submit() for a call that is rejected there.
  PageCalls(std::string socket, std::function<void(const Reply&)> on_reply);

  /// Queues a call and returns immediately. Rejects a method that permits() excludes. Thread-safe.
  void submit(Call call);

  /// Returns true for the methods that the page may call: those of rendering, scene, workspace, recording
  /// and status. PageLease arms and disarms; PageHand moves the hand.
  static bool permits(std::string_view method) noexcept;

 private:
  void run(const std::stop_token& stop);
  Reply execute(const Call& call);
  std::string send(const Call& call);

  std::string socket_;
  std::function<void(const Reply&)> on_reply_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Call> pending_;
  std::optional<Client> client_;  ///< used only by thread_
  std::jthread thread_;           ///< declared last, because the thread uses all members above
};

}  // namespace wrenchd
