// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "collision/scene.hpp"

namespace wrenchd {

/// What a tick of the proxy costs in a scene.
struct QueryCost {
  std::size_t ticks = 0;          ///< number of ticks in which the tool was near an obstacle; 0: none was
  std::uint32_t p99_visits = 0;   ///< node visits that 99 % of the ticks do not exceed
  std::uint32_t most_visits = 0;  ///< node visits of the most expensive tick
  double p99_s = 0.0;             ///< processor time that 99 % of the ticks do not exceed [s]
  double longest_s = 0.0;         ///< processor time of the longest tick [s]
};

/// Estimates the largest cost of a query from the meshes alone: presses faces of the tool onto faces of each
/// mesh obstacle, and slides and rotates it there, as a hand of 0.1 m/s and 2 rad/s does. The motions are the
/// same in every run; the times are those of this machine. seconds: the estimate stops after this processor
/// time. Not RT-safe: allocates, takes up to `seconds`.
QueryCost estimate_query_cost(const Scene& scene, double seconds);

/// Returns "99 % within 31 us and 260 node visits, at most 106 us and 655 (pressed and slid for 4800 ticks,
/// on this machine)". Not RT-safe: allocates.
std::string text(const QueryCost& cost);

}  // namespace wrenchd
