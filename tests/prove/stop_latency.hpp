// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "daemon/servo/tick_record.hpp"
#include "tests/prove/abusers.hpp"

namespace wrenchd::test {

/// An emergency stop that a user without a role requested.
struct StopRequest {
  std::size_t kind = 0;      ///< the abuse meanwhile: its place in kAbuseNames; their number: all of them
  std::int64_t sent_ns = 0;  ///< CLOCK_MONOTONIC, as the times of the ticks
};

/// Requests emergency stops of an armed daemon during each kind of abuse. The daemon must not be armed by
/// somebody else. Throws std::exception.
std::vector<StopRequest> request_stops(const std::filesystem::path& socket, Abusers& abusers, int per_kind);

/// Time from the request of a stop to the tick that stopped.
struct StopLatency {
  long stops = 0, missed = 0;
  double p50_ms = 0.0, max_ms = 0.0;
};

/// The stops during one kind of abuse, as StopRequest::kind, from the ticks of the daemon's recording.
StopLatency stop_latency(const std::vector<StopRequest>& requests, std::size_t kind,
                         const std::vector<TickRecord>& ticks);

}  // namespace wrenchd::test
