// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <sys/types.h>

#include "tools/view/page_files.hpp"

namespace wrenchd {

class LiveFeed;
class RecordedFeed;

/// Returns the user at the other end of a TCP connection, from the ports of both ends. Tests replace
/// connection_owner().
using IdentifyConnection =
    std::function<std::optional<uid_t>(std::uint16_t peer_port, std::uint16_t own_port)>;

/// Serves the view's page to browsers on this machine, and its data over a WebSocket. Listens only on
/// 127.0.0.1. Closes connections of other users than its own and root at once, before they count. Rejects
/// requests without the token in the address, and requests from other web pages (Host and Origin). Runs on
/// the thread that calls run().
///
///   http://127.0.0.1:PORT/TOKEN/         the page and its files
///   ws://127.0.0.1:PORT/TOKEN/live       messages: JSON, and binary ones for meshes and curves
///
/// A page that reads slowly receives fewer frames and delays no other page. Not RT-safe: runs a server.
class ViewServer {
 public:
  /// port: 0 selects a free port, and so does a port that is taken; url() contains it. The feed must outlive
  /// this object. Throws std::runtime_error if the server cannot listen.
  ViewServer(std::uint16_t port, PageFiles files, LiveFeed& feed,
             IdentifyConnection identify = identify_connection);
  ViewServer(std::uint16_t port, PageFiles files, const RecordedFeed& feed,
             IdentifyConnection identify = identify_connection);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// Shows a second recording beside the first one, on the same time axis. The feed must outlive this object.
  /// Call before run().
  void compare_with(const RecordedFeed& other) noexcept;

  std::string url() const;
  /// opened: called on the thread of run() when a browser has requested the page for the first time.
  void on_first_page(std::function<void()> opened);
  /// Runs until SIGINT, SIGTERM or stop(). Releases the lease at the end, which disarms the loop.
  void run();
  void stop();  ///< thread-safe

 private:
  static std::optional<uid_t> identify_connection(std::uint16_t peer_port, std::uint16_t own_port);

  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace wrenchd
