// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <filesystem>
#include <vector>

#include "tools/spacenav/spacenav_client.hpp"

namespace wrenchd {

/// The socket of spacenavd, to which every program of libspnav connects. Not RT-safe: system calls.
class SpacenavServer {
 public:
  static constexpr std::size_t kMostClients = 32;

  /// all_users: other users may connect; else only the owner. Throws std::runtime_error with the path and the
  /// remedy if another program serves the socket, or if the path is no socket.
  SpacenavServer(const std::filesystem::path& path, bool all_users);
  ~SpacenavServer();
  SpacenavServer(const SpacenavServer&) = delete;
  SpacenavServer& operator=(const SpacenavServer&) = delete;

  /// Accepts programs and answers their requests until the time is over, or until the descriptor `end_fd` can
  /// be read.
  void serve(const SpacenavDevice& device, std::chrono::milliseconds time, int end_fd);

  void send_motion(const AxisRates& rates, double dt_s);
  void send_button(int number, bool pressed);
  void send_device_change(bool connected);

  std::size_t clients() const noexcept { return clients_.size(); }

 private:
  void accept_client();

  std::filesystem::path path_;
  OwnedFd socket_;
  dev_t device_ = 0;  ///< device of the socket file: the destructor removes no other file
  ino_t inode_ = 0;   ///< inode of the socket file
  std::vector<SpacenavClient> clients_;
};

}  // namespace wrenchd
