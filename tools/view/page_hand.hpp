// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <wrenchd/client.hpp>

#include "core/pose.hpp"

namespace wrenchd {

/// Moves the hand of a simulated device for the pages that drag the tool, with the rights of the user of this
/// program. A goal that the daemon has not taken yet is replaced by the next one. A thread of this object
/// waits for the daemon; move() does not. Not RT-safe: locks a mutex.
class PageHand {
 public:
  /// The hand returns to its path after this time without a goal.
  static constexpr auto kExpires = std::chrono::milliseconds(300);

  /// on_rejection: called on the thread of this object, with the page and the daemon's reason.
  PageHand(std::string socket,
           std::function<void(std::uint64_t page, const std::string& error)> on_rejection);

  /// Sends the hand to a pose in the device base and returns immediately. Thread-safe.
  void move(std::uint64_t page, const Pose& X_BG);

 private:
  struct Goal {
    std::uint64_t page;
    Pose X_BG;
  };
  void run(const std::stop_token& stop);
  void send(const Goal& goal);

  std::string socket_;
  std::function<void(std::uint64_t, const std::string&)> on_rejection_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Goal> next_;
  std::optional<Client> client_;  ///< used only by thread_
  std::jthread thread_;           ///< declared last, because the thread uses all members above
};

/// Returns the goal of a hand that was at X_BH when the drag began, and is moved from there by d_W_m and
/// rotated by r_W_rad about the handle point, both in axes of the world. RT-safe.
Pose dragged(const Pose& X_BH, const Quaterniond& R_WB, const Vector3d& d_W_m,
             const Vector3d& r_W_rad) noexcept;

}  // namespace wrenchd
