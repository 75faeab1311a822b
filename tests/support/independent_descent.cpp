// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/independent_descent.hpp"

#include <algorithm>
#include <cmath>

#include "core/metric.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {
namespace {

constexpr double kLongestStep_m = 1e-4;
/// Factors on the length of the steps after a success and after a failure: constant at one success in five.
constexpr double kLonger = 1.5, kShorter = 0.9036;

}  // namespace

double descend_at_random(const ExactIntersection& exact, const Inertia& M, const Pose& X_WP, const Pose& X_WQ,
                         const Pose& X_WO, const Pose& X_TE, std::uint64_t seed, int steps) {
  RandomValues random(seed);
  const double radius_m = std::sqrt(M.H_kg_m2.trace() / (2.0 * M.mass_kg));
  const Pose X_OW = inverse(X_WO);
  Pose best = X_WQ;
  double least = energy(M, X_WP, X_WQ);
  double step_m = std::min(kLongestStep_m, 0.1 * std::sqrt(2.0 * least / M.mass_kg));
  for (int i = 0; i < steps; ++i) {
    Pose trial = best;
    trial.translation_m += random.vector<3>(step_m / std::sqrt(6.0));
    trial.rotation =
        (rotation_from(random.vector<3>(step_m / std::sqrt(6.0) / radius_m)) * trial.rotation).normalized();
    const double T = energy(M, X_WP, trial);
    const bool better = T < least && !exact.intersect(X_OW * trial * X_TE);
    if (better) best = trial, least = T;
    step_m = std::min(kLongestStep_m, step_m * (better ? kLonger : kShorter));
  }
  return least;
}

}  // namespace wrenchd::test
