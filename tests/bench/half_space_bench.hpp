// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tests/bench/method_timing.hpp"
#include "tests/bench/table.hpp"

namespace wrenchd::bench {

/// A body in a half-space, by each method.
std::vector<Table> bench_half_space(const Effort& effort, const CounterScale& scale);

/// The planar family at one contact, on its own: what one plane costs.
Table bench_planar_family(const Effort& effort, const CounterScale& scale);

}  // namespace wrenchd::bench
