// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Options that the commands for a running daemon share.
struct ControlOptions {
  std::string socket;  ///< path of the daemon's socket; empty: default paths
  bool json = false;   ///< print the daemon's response unchanged
  std::vector<std::string> events;
  std::string method;
  std::string file;
  std::string output;
  std::vector<std::string> conditions;  ///< "stiffness=2000"
  bool preempt = false;
};

// Commands of `wrenchctl` for a running daemon. Each prints to standard output and throws ClientError. Not
// RT-safe: each waits for the daemon.

void run_status(const ControlOptions& options);
/// Prints events until the daemon ends or a signal arrives.
void run_watch(const ControlOptions& options);
/// Acquires the lease, arms, and keeps both until a signal arrives; then disarms. Returns the exit code: 0
/// after a signal, 1 if the daemon removed the force.
int run_arm(const ControlOptions& options);
/// Sends a request without parameters, and prints its effect.
void run_request(const std::string& method, const ControlOptions& options);
/// options.method: start, stop, mark, status, list or get.
void run_record(const ControlOptions& options);
void run_describe(const ControlOptions& options);

/// Returns the daemon's status as text for the user.
std::string status_text(const Json& status);
/// Returns an event as one line for the user.
std::string event_text(const Json& event);

}  // namespace wrenchd
