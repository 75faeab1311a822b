// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace wrenchd::test {

/// What clients reach that try to use up what the daemon has.
struct Hoarding {
  long most_fds = 0;     ///< descriptors of the daemon while 31 clients request some and read none
  double stop_ms = 0.0;  ///< answer to a stop request of another user meanwhile
  long asked = 0;        ///< slow requests of another user while one fills the queue
  long refused = 0;      ///< of these, requests without a result
  long swaps = 0;        ///< changes of a mesh name between FIFO, symbolic link and file
  long adds = 0;         ///< requests of an operator to load this name meanwhile
  long leaks = 0;        ///< replies that contain a file to which the link leads
  double end_ms = 0.0;   ///< from SIGTERM to the end while a mesh of 10 million triangles is made
  std::vector<std::string> violations;
};

/// Runs a daemon, lets clients exhaust it, and ends it. program: path of wrenchd. directory: for its files;
/// other users may enter it. Without root, all clients are of one user, so that starvation and leaks are not
/// measured. Throws std::exception if the daemon does not start.
Hoarding hoard(const std::string& program, const std::filesystem::path& directory);

}  // namespace wrenchd::test
