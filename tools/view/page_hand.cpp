// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/page_hand.hpp"

#include <array>
#include <chrono>
#include <utility>

namespace wrenchd {
namespace {

constexpr auto kHandTimeout = std::chrono::seconds(2);

std::array<double, 3> coordinates_of(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

Pose dragged(const Pose& X_BH, const Quaterniond& R_WB, const Vector3d& d_W_m,
             const Vector3d& r_W_rad) noexcept {
  const Quaterniond R_BW = R_WB.conjugate();
  return {(rotation_from(R_BW * r_W_rad) * X_BH.rotation).normalized(), X_BH.translation_m + R_BW * d_W_m};
}

PageHand::PageHand(std::string socket, std::function<void(std::uint64_t, const std::string&)> on_rejection)
    : socket_(std::move(socket)), on_rejection_(std::move(on_rejection)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void PageHand::move(std::uint64_t page, const Pose& X_BG) {
  {
    const std::scoped_lock lock(mutex_);
    next_ = Goal{page, X_BG};
  }
  changed_.notify_all();
}

void PageHand::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::optional<Goal> goal;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return next_.has_value(); })) return;
      goal = std::exchange(next_, std::nullopt);
    }
    send(*goal);
  }
}

void PageHand::send(const Goal& goal) {
  try {
    if (!client_) client_.emplace(socket_, kHandTimeout);
    client_->move_hand(coordinates_of(goal.X_BG.translation_m),
                       coordinates_of(rotation_vector(goal.X_BG.rotation)), kExpires);
  } catch (const ClientError& error) {
    if (error.code() > 0) client_.reset();  // an error of the connection, not a response of the daemon
    on_rejection_(goal.page, error.what());
  }
}

}  // namespace wrenchd
