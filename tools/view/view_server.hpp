// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "tools/view/page_files.hpp"

namespace wrenchd {

class LiveFeed;
class RecordedFeed;

/// Serves the page of the view to browsers on this machine, and what they show over a WebSocket. Listens on
/// 127.0.0.1 alone; answers nobody who does not know the token in the address, or whose browser was sent by
/// another page (Host and Origin). One thread, that of run().
///
///   http://127.0.0.1:PORT/TOKEN/         the page and its files
///   ws://127.0.0.1:PORT/TOKEN/live       messages: JSON, and binary ones for meshes and curves
///
/// A browser that does not read gets fewer frames, and nobody waits for it.
class ViewServer {
 public:
  /// port: 0: one that is free. Throws std::runtime_error where it cannot listen. The feed must outlive this.
  ViewServer(std::uint16_t port, PageFiles files, LiveFeed& feed);
  ViewServer(std::uint16_t port, PageFiles files, const RecordedFeed& feed);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  std::string url() const;
  /// Until SIGINT, SIGTERM or stop(). Whatever a page has armed is disarmed at the end.
  void run();
  void stop();  ///< any thread

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace wrenchd
