// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "tests/bench/method_timing.hpp"
#include "tests/bench/peer.hpp"
#include "tests/bench/table.hpp"

namespace wrenchd::bench {

/// Meshes against meshes: our list of all pairs that meet, our whole tick, and the peers' lists of contacts.
std::vector<Table> bench_meshes(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers);

/// How the cost grows with the number of triangles, from two thousand to two million.
Table bench_growth(const Effort& effort, const CounterScale& scale);

}  // namespace wrenchd::bench
