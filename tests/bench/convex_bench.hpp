// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "tests/bench/method_timing.hpp"
#include "tests/bench/peer.hpp"
#include "tests/bench/table.hpp"

namespace wrenchd::bench {

/// Times a convex body on another: wrenchd against the penetration query of each peer.
std::vector<Table> bench_convex(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers);

}  // namespace wrenchd::bench
