// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/method_timing.hpp"

#include <algorithm>
#include <cstdint>

namespace wrenchd::bench {
namespace {

/// On an idle machine the passes of one method differ by a few per cent.
constexpr double kInconclusive = 0.1;

std::vector<double> timed_pass(const TimedMethod& runner, std::size_t poses, const CounterScale& scale) {
  std::vector<double> ns;
  volatile double answer = 0.0;  // keeps the compiler from removing the solve
  runner.restart();
  for (std::size_t i = 0; i < poses; i += runner.every) {
    const std::int64_t before = counter();
    answer = runner.solve(i).value;
    ns.push_back(scale.ns(counter() - before));
  }
  static_cast<void>(answer);
  return ns;
}

}  // namespace

std::vector<MethodTiming> time_methods(const std::vector<TimedMethod>& runners, std::size_t poses, int passes,
                                       const CounterScale& scale) {
  std::vector<MethodTiming> results(runners.size());
  for (std::size_t r = 0; r < runners.size(); ++r) {
    results[r].name = runners[r].name;
    runners[r].restart();
    for (std::size_t i = 0; i < poses; ++i)
      results[r].answers.push_back(i % runners[r].every == 0 ? runners[r].solve(i) : Answer{kNoAnswer});
  }

  std::vector<std::vector<double>> least_ns(runners.size());
  std::vector<std::vector<double>> p50_ns(runners.size());
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t r = 0; r < runners.size(); ++r) {
      const std::vector<double> ns = timed_pass(runners[r], poses, scale);
      p50_ns[r].push_back(quantile(ns, 0.5));
      if (pass == 0) least_ns[r] = ns;
      for (std::size_t i = 0; i < ns.size(); ++i) least_ns[r][i] = std::min(least_ns[r][i], ns[i]);
    }
  for (std::size_t r = 0; r < runners.size(); ++r) {
    results[r].ns = quantiles(least_ns[r]);
    results[r].relative_spread = relative_spread(p50_ns[r]);
  }
  return results;
}

std::string verdict(const MethodTiming& result) {
  return result.relative_spread > kInconclusive ? "inconclusive" : "";
}

}  // namespace wrenchd::bench
