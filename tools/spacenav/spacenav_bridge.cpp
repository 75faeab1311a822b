// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/spacenav/spacenav_bridge.hpp"

#include <cstdio>
#include <utility>

#include <nlohmann/json.hpp>
#include <poll.h>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

constexpr auto kRetry = 1s;
/// If the daemon sends no tick for this time, programs receive a motion of zero.
constexpr auto kSilence = 100ms;
/// The difference of two poses that are farther apart in time is not sent as motion.
constexpr double kLongestStep_s = 0.5;

std::string device_name(const std::string& status) {
  const auto json = nlohmann::json::parse(status, nullptr, false);
  const nlohmann::json::json_pointer profile("/device/profile");
  const bool has_profile = json.is_object() && json.contains(profile) && json[profile].is_string();
  return "wrenchd: " + (has_profile ? json[profile].get<std::string>() : std::string("no device"));
}

}  // namespace

SpacenavBridge::SpacenavBridge(SpacenavServer& server, SpacenavOptions options)
    : server_(server), options_(std::move(options)) {}

void SpacenavBridge::run(int end_fd) {
  pollfd end{end_fd, POLLIN, 0};
  while (::poll(&end, 1, 0) == 0) {
    server_.serve(device_, options_.period, end_fd);
    try {
      if (source_)
        send_news();
      else if (std::chrono::steady_clock::now() >= next_try_)
        connect();
    } catch (const ClientError& error) {
      disconnect(error.what());
    }
  }
}

void SpacenavBridge::connect() {
  next_try_ = std::chrono::steady_clock::now() + kRetry;
  Client client(options_.daemon_socket);
  device_ = {device_name(client.status()), client.socket(), true};
  StateReader state = client.open_state();
  source_.emplace(Source{std::move(client), std::move(state)});
  std::printf("connected to %s (%s)\n", device_.name.c_str(), device_.path.c_str());
  std::fflush(stdout);
  told_.clear();
  server_.send_device_change(true);
}

void SpacenavBridge::disconnect(const std::string& why) {
  if (why != told_) std::fprintf(stderr, "%s; trying again\n", why.c_str());
  told_ = why;
  if (source_) {
    stop_motion();
    send_buttons(0);
    server_.send_device_change(false);
  }
  source_.reset();
  device_.connected = false;
  last_X_W_.reset();
}

void SpacenavBridge::send_news() {
  bool any = false;
  while (source_->state.next(tick_, 0ms)) {
    any = true;
    send_buttons(static_cast<std::uint32_t>(tick_.integer("buttons")));
  }
  const auto now = std::chrono::steady_clock::now();
  if (!any) {
    if (now - last_tick_ > kSilence) stop_motion();
    return;
  }
  last_tick_ = now;
  const PoseNumbers X_W = options_.pose == SteeringPose::tool ? tick_.proxy_pose() : tick_.hand_pose();
  const double dt_s = 1e-9 * static_cast<double>(tick_.time_ns() - last_ns_);
  if (last_X_W_ && dt_s > 0.0 && dt_s < kLongestStep_s)
    server_.send_motion(axis_rates(*last_X_W_, X_W, dt_s, options_.full), dt_s);
  last_X_W_ = X_W;
  last_ns_ = tick_.time_ns();
}

/// Some programs continue with the last deflection until they receive another one.
void SpacenavBridge::stop_motion() {
  server_.send_motion({}, std::chrono::duration<double>(options_.period).count());
}

void SpacenavBridge::send_buttons(std::uint32_t pressed) {
  for (int i = 0; i < 32; ++i)
    if (((pressed ^ buttons_) >> i & 1U) != 0) server_.send_button(i, (pressed >> i & 1U) != 0);
  buttons_ = pressed;
}

}  // namespace wrenchd
