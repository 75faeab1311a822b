// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "tests/bench/statistics.hpp"
#include "tests/bench/stopwatch.hpp"

namespace wrenchd::bench {

/// The number of poses and passes of a benchmark.
struct Effort {
  std::size_t poses = 2000;
  int passes = 5;
  bool quick = false;  ///< only small cases
};

/// The value of an answer of a method that found nothing, or did not solve the pose.
inline constexpr double kNoAnswer = std::numeric_limits<double>::quiet_NaN();

/// The result of one method at one pose. A method fills the fields that it computes.
struct Answer {
  /// energy or depth, depending on the table; or kNoAnswer
  double value = 0.0;
  double kkt_residual = 0.0;
  std::size_t active = 0;  ///< number of active contacts at q
  bool converged = true;
};

/// A method to be timed on a sequence of poses.
struct TimedMethod {
  std::string name;
  std::function<void()> restart;             ///< restores the state before the first pose; not timed
  std::function<Answer(std::size_t)> solve;  ///< solves the pose with this index; poses come in order
  std::size_t every = 1;  ///< solves only the poses whose index is a multiple; the others have no answer
};

struct MethodTiming {
  std::string name;
  std::vector<Answer> answers;
  Quantiles ns;            ///< quantiles over the solved poses of the minimum time over the passes
  double relative_spread;  ///< relative spread of the p50 of the single passes
};

/// Times the methods in alternating passes, so that a disturbance of the machine affects all methods. One
/// untimed pass runs first, to collect the answers and to warm the caches. The time of a pose is the minimum
/// over the passes, which excludes the cost of other programs.
std::vector<MethodTiming> time_methods(const std::vector<TimedMethod>& runners, std::size_t poses, int passes,
                                       const CounterScale& scale);

/// Returns "inconclusive" if the passes differ too much for a comparison with other methods; otherwise an
/// empty text.
std::string verdict(const MethodTiming& result);

}  // namespace wrenchd::bench
