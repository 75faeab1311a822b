// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// How a command speaks to the daemon, and to a person.
struct ControlOptions {
  std::string socket;  ///< empty: the usual places
  bool json = false;   ///< what the daemon answers, as it is
  std::vector<std::string> events;
  std::string method;
  std::string file;
  std::string output;
  bool preempt = false;
};

// What `wrenchctl` does with a daemon that runs. Each prints to standard output, and throws what Client
// throws.

void run_status(const ControlOptions& options);
/// Prints events until the daemon ends, or a signal comes.
void run_watch(const ControlOptions& options);
/// Takes the lease, arms, and keeps both until a signal comes; then disarms. Returns the exit code: 0 when it
/// was ended so, 1 when the daemon took the force away.
int run_arm(const ControlOptions& options);
/// One request without parameters, and what follows from it.
void run_request(const std::string& method, const ControlOptions& options);
/// options.method: start, stop, status, list or get.
void run_record(const ControlOptions& options);
void run_describe(const ControlOptions& options);

/// The status for a person.
std::string status_text(const Json& status);
/// One line for an event.
std::string event_text(const Json& event);

}  // namespace wrenchd
