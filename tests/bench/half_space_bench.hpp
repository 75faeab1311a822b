// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tests/bench/method_timing.hpp"
#include "tests/bench/table.hpp"

namespace wrenchd::bench {

/// Times a body in a half-space with each projection method.
std::vector<Table> bench_half_space(const Effort& effort, const CounterScale& scale);

/// Times the planar family at one contact, which gives the cost per plane.
Table bench_planar_family(const Effort& effort, const CounterScale& scale);

}  // namespace wrenchd::bench
