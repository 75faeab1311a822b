// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tests/bench/method_timing.hpp"
#include "tests/bench/peer.hpp"
#include "tests/bench/table.hpp"

namespace wrenchd::bench {

/// Times mesh against mesh: wrenchd's list of all intersecting pairs, wrenchd's whole tick, and each peer's
/// contact list. only: runs only the cases whose name contains this text.
std::vector<Table> bench_meshes(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers, const std::string& only = {});

/// Times the whole tick for 2,000 to 2,000,000 triangles.
Table bench_growth(const Effort& effort, const CounterScale& scale);

}  // namespace wrenchd::bench
