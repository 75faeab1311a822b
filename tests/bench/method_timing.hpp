// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tests/bench/statistics.hpp"
#include "tests/bench/stopwatch.hpp"

namespace wrenchd::bench {

/// How much is measured.
struct Effort {
  std::size_t poses = 2000;
  int passes = 5;
  bool quick = false;  ///< small cases only
};

/// What a method says of one pose, as far as it says it.
struct Answer {
  double value = 0.0;  ///< energy or depth, as the race has it; NaN where nothing was found
  double kkt_residual = 0.0;
  std::size_t active = 0;  ///< contacts that touch at q
  bool converged = true;
};

/// One method, to be timed on a row of poses.
struct TimedMethod {
  std::string name;
  std::function<void()> restart;             ///< back to the state before the first pose; not timed
  std::function<Answer(std::size_t)> solve;  ///< the pose with this number; they come in order
};

struct MethodTiming {
  std::string name;
  std::vector<Answer> answers;
  Quantiles ns;            ///< over the poses, of the least time of each over the passes
  double relative_spread;  ///< of the p50 of the single passes
};

/// Times the methods in turn, pass after pass, so that what disturbs the machine disturbs all of them; one
/// pass more goes before, untimed, for the answers and to warm the caches. A pose's time is the least over
/// the passes: what the code costs, not what the neighbours cost.
std::vector<MethodTiming> time_methods(const std::vector<TimedMethod>& runners, std::size_t poses, int passes,
                                       const CounterScale& scale);

/// "inconclusive" where the passes differ by too much for the times to be compared with others.
std::string verdict(const MethodTiming& result);

}  // namespace wrenchd::bench
