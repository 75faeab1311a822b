// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "tools/view/page_files.hpp"

namespace wrenchd {

class LiveFeed;
class RecordedFeed;

/// Serves the view's page to browsers on this machine, and its data over a WebSocket. Listens only on
/// 127.0.0.1, and serves only processes of its own user and of root. Rejects requests without the token in
/// the address, and requests from other web pages (Host and Origin). Runs on the thread that calls run().
///
///   http://127.0.0.1:PORT/TOKEN/         the page and its files
///   ws://127.0.0.1:PORT/TOKEN/live       messages: JSON, and binary ones for meshes and curves
///
/// A page that reads slowly receives fewer frames and delays no other page. Not RT-safe: runs a server.
class ViewServer {
 public:
  /// port: 0 selects a free port. The feed must outlive this object. Throws std::runtime_error if the server
  /// cannot listen.
  ViewServer(std::uint16_t port, PageFiles files, LiveFeed& feed);
  ViewServer(std::uint16_t port, PageFiles files, const RecordedFeed& feed);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  std::string url() const;
  /// Runs until SIGINT, SIGTERM or stop(). Releases the lease at the end, which disarms the loop.
  void run();
  void stop();  ///< thread-safe

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace wrenchd
