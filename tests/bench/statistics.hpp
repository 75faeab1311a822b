// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

namespace wrenchd::bench {

/// The value that a share of the values lie at or below: the nearest rank, no interpolation. NaN of none.
double quantile(std::vector<double> values, double share);

/// How times are reported. Never the mean: a tick that is late is late.
struct Quantiles {
  double p50, p99, p999, max;
};
Quantiles quantiles(const std::vector<double>& values);

/// How far the largest is above the smallest, as a share of the smallest.
double relative_spread(const std::vector<double>& values);

}  // namespace wrenchd::bench
