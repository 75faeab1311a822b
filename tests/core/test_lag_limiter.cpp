// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "core/lag_limiter.hpp"

namespace wrenchd::test_lag_limiter {

TEST_CASE("a proxy that keeps up is not limited", "[lag_limiter]") {
  LagLimiter limiter;
  for (const double energy : {0.0, 1.0, 100.0, 0.5}) CHECK(limiter.scale(energy, false) == 1.0);
}

TEST_CASE("a proxy that lags in free space makes no force", "[lag_limiter]") {
  LagLimiter limiter;
  limiter.scale(0.0, false);
  CHECK(limiter.scale(1e-6, true) == 0.0);
  CHECK(limiter.scale(1.0, true) == 0.0);
  CHECK(limiter.scale(1.0, false) == 1.0);
}

TEST_CASE("a proxy that lags in contact makes no more force than when it kept up", "[lag_limiter]") {
  // A spring of stiffness 1: energy = d^2 / 2, force = d.
  const auto energy = [](double d) { return 0.5 * d * d; };
  LagLimiter limiter;
  limiter.scale(energy(2.0), false);
  CHECK(5.0 * limiter.scale(energy(5.0), true) == Approx(2.0));
  CHECK(9.0 * limiter.scale(energy(9.0), true) == Approx(2.0));
  CHECK(limiter.scale(energy(1.5), true) == 1.0);  // the hand goes back
  CHECK(7.0 * limiter.scale(energy(7.0), true) == Approx(2.0));
}

TEST_CASE("the limited force has no work around a closed path", "[lag_limiter]") {
  LagLimiter limiter;
  limiter.scale(0.5, false);
  double work = 0.0;
  constexpr int kSteps = 10000;
  for (int i = 0; i < kSteps; ++i) {
    const double turn = 6.283185307179586 / kSteps, angle = turn * (i + 0.5);
    const double x = 2.0 + 3.0 * std::cos(angle), y = 3.0 * std::sin(angle), energy = 0.5 * (x * x + y * y);
    const double scale = limiter.scale(energy, true);
    work += -scale * (x * -3.0 * std::sin(angle) + y * 3.0 * std::cos(angle)) * turn;
  }
  CHECK(std::abs(work) < 1e-5);
}

TEST_CASE("a new proxy begins without energy", "[lag_limiter]") {
  LagLimiter limiter;
  limiter.scale(10.0, false);
  limiter.reset();
  CHECK(limiter.scale(1.0, true) == 0.0);
}

}  // namespace wrenchd::test_lag_limiter
