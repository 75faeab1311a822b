// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

namespace wrenchd::bench {

/// Returns the smallest value that at least this share of the values do not exceed (nearest rank, no
/// interpolation). NaN if there are no values.
double quantile(std::vector<double> values, double share);

/// Quantiles of a time. Reports show quantiles and never the mean, because a single late tick matters.
struct Quantiles {
  double p50, p99, p999, max;
};
Quantiles quantiles(const std::vector<double>& values);

/// Returns (largest - smallest) / smallest.
double relative_spread(const std::vector<double>& values);

}  // namespace wrenchd::bench
