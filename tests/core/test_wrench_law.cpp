// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/wrench_law.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_wrench_law {

using std::numbers::pi;
using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;

Vector6d stacked(const Wrench& F) {
  Vector6d v;
  v << F.force_N, F.torque_Nm;
  return v;
}

Vector6d zero() {
  return Vector6d::Zero();
}

/// Proportional, integral or derivative gain alone, with wide limits.
WrenchGains stiff(const Matrix6d& K) {
  WrenchGains gains;
  gains.stiffness = K;
  return gains;
}
WrenchGains integral(const Matrix6d& K, double limit_N = 1e9, double limit_Nm = 1e9) {
  WrenchGains gains;
  gains.integral = K;
  gains.integral_limit_N = limit_N;
  gains.integral_limit_Nm = limit_Nm;
  return gains;
}
WrenchGains damped(const Matrix6d& K, double cutoff_Hz) {
  WrenchGains gains;
  gains.damping = K;
  gains.derivative_cutoff_Hz = cutoff_Hz;
  return gains;
}

Matrix6d full(RandomValues& random) {
  return Matrix6d::NullaryExpr([&] { return random.normal(); });
}

}  // namespace

TEST_CASE("P alone: the wrench is K_P eps immediately, with all 36 entries", "[wrench_law]") {
  RandomValues random(1);
  for (int i = 0; i < 1'000; ++i) {
    const Matrix6d K = full(random);  // in general not even symmetric
    WrenchLaw law(stiff(K));
    const Vector6d eps = random.vector<6>();
    REQUIRE((stacked(law.update(eps, true, kTick_s)) - K * eps).norm() <= 1e-14 * K.norm() * eps.norm());
  }
}

TEST_CASE("each entry of a gain couples one component of eps to one of the wrench", "[wrench_law]") {
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column) {
      Matrix6d K = zero() * zero().transpose();
      K(row, column) = 3.0;
      WrenchLaw law(stiff(K));
      REQUIRE(stacked(law.update(2.0 * Vector6d::Unit(column), true, kTick_s)) == 6.0 * Vector6d::Unit(row));
    }
}

TEST_CASE("the paper's example: k_P = 1 gives the difference vector itself", "[wrench_law]") {
  Vector6d eps;
  eps << -0.29606622, 2.05106566, 0.0, 0.0, 0.0, 0.11328538;
  WrenchLaw law(stiff(WrenchGains::scalar(1.0)));
  CHECK(stacked(law.update(eps, true, kTick_s)) == eps);
}

TEST_CASE("blockwise: one gain for the force, one for the torque", "[wrench_law]") {
  WrenchLaw law(stiff(WrenchGains::blockwise(200.0, 5.0)));
  const Wrench F = law.update((Vector6d() << 1, 2, 3, 4, 5, 6).finished(), true, kTick_s);
  CHECK(F.force_N == Vector3d(200.0, 400.0, 600.0));
  CHECK(F.torque_Nm == Vector3d(20.0, 25.0, 30.0));
}

TEST_CASE("outside contact the wrench is zero for any eps and history", "[wrench_law]") {
  RandomValues random(2);
  WrenchGains gains = stiff(full(random));
  gains.integral = full(random);
  gains.damping = full(random);
  WrenchLaw law(gains);
  for (int i = 0; i < 200; ++i) {
    law.update(random.vector<6>(), true, kTick_s);
    REQUIRE(stacked(law.update(random.vector<6>(), false, kTick_s)) == zero());
  }
}

TEST_CASE("I: the rectangle rule over real time steps", "[wrench_law]") {
  RandomValues random(3);
  for (int i = 0; i < 100; ++i) {
    const Matrix6d K = full(random);
    WrenchLaw law(integral(K));
    Vector6d sum = zero();
    for (int tick = 0; tick < 50; ++tick) {
      const Vector6d eps = random.vector<6>();
      const double dt_s = random.log_uniform(1e-4, 1e-2);
      sum += dt_s * eps;
      REQUIRE((stacked(law.update(eps, true, dt_s)) - K * sum).norm() <= 1e-14);
    }
  }
}

TEST_CASE("anti-windup: the integral's force stops at its limit and leaves it when eps reverses",
          "[wrench_law]") {
  WrenchLaw law(integral(WrenchGains::scalar(10.0), 2.0, 1e9));
  const Vector6d eps = Vector6d::Unit(0);
  double force_N = 0.0;
  for (int tick = 0; tick < 10'000; ++tick) {  // 10 s: 100 N without the limit
    force_N = law.update(eps, true, kTick_s).force_N.x();
    REQUIRE(force_N <= 2.0 * (1.0 + 1e-15));
  }
  CHECK(force_N == Approx(2.0).epsilon(1e-14));
  for (int tick = 1; tick <= 100; ++tick)
    REQUIRE(law.update(-eps, true, kTick_s).force_N.x() == Approx(2.0 - 0.01 * tick).epsilon(1e-12));
}

TEST_CASE("anti-windup: the torque has its own limit", "[wrench_law]") {
  WrenchLaw law(integral(WrenchGains::scalar(10.0), 1e9, 0.5));
  double torque_Nm = 0.0;
  for (int tick = 0; tick < 1'000; ++tick) {
    torque_Nm = law.update(Vector6d::Unit(5), true, kTick_s).torque_Nm.z();
    REQUIRE(torque_Nm <= 0.5 * (1.0 + 1e-15));
  }
  CHECK(torque_Nm == Approx(0.5).epsilon(1e-14));
  CHECK(law.update(-Vector6d::Unit(5), true, kTick_s).torque_Nm.z() == Approx(0.49).epsilon(1e-12));
}

TEST_CASE("anti-windup holds for any coupling, path and time step", "[wrench_law]") {
  RandomValues random(4);
  for (int i = 0; i < 50; ++i) {
    WrenchLaw law(integral(100.0 * full(random), 1.5, 0.25));
    const Vector6d drift = random.vector<6>();
    for (int tick = 0; tick < 500; ++tick) {
      const Wrench F = law.update(drift + random.vector<6>(), true, random.log_uniform(1e-5, 1.0));
      REQUIRE(F.force_N.norm() <= 1.5 * (1.0 + 1e-13));
      REQUIRE(F.torque_Nm.norm() <= 0.25 * (1.0 + 1e-13));
    }
  }
}

TEST_CASE("an integral at its limit still follows eps to another direction", "[wrench_law]") {
  WrenchLaw law(integral(WrenchGains::scalar(10.0), 2.0, 1e9));
  for (int tick = 0; tick < 1'000; ++tick) law.update(Vector6d::Unit(0), true, kTick_s);
  Wrench F;
  for (int tick = 0; tick < 5'000; ++tick) F = law.update(Vector6d::Unit(1), true, kTick_s);
  CHECK(F.force_N.y() > 1.99);
  CHECK(std::abs(F.force_N.x()) < 0.1);
}

TEST_CASE("D: the step response of a first-order low pass by backward Euler", "[wrench_law]") {
  // eps rises by c in every tick from 0: the raw derivative is c/dt from the first tick on, and after n ticks
  //   rate_n = (c/dt) (1 - (1 - a)^n),   a = dt / (dt + 1/(2 pi f))
  RandomValues random(5);
  for (int i = 0; i < 100; ++i) {
    const double f = random.log_uniform(1.0, 1e4);
    const double dt_s = random.log_uniform(1e-5, 1e-1);
    const Matrix6d K = full(random);
    const Vector6d slope = random.vector<6>();
    WrenchLaw law(damped(K, f));
    const double a = dt_s / (dt_s + 1.0 / (2.0 * pi * f));
    for (int n = 1; n <= 100; ++n) {
      const Vector6d expected = K * slope * (1.0 - std::pow(1.0 - a, n));
      const Vector6d F = stacked(law.update(n * dt_s * slope, true, dt_s));
      REQUIRE((F - expected).norm() <= 1e-11 * (1.0 + (K * slope).norm()));
    }
  }
}

TEST_CASE("D: a step of eps gives a decaying impulse", "[wrench_law]") {
  const double f = 100.0;
  const double a = kTick_s / (kTick_s + 1.0 / (2.0 * pi * f));
  WrenchLaw law(damped(WrenchGains::scalar(1.0), f));
  for (int n = 1; n <= 50; ++n) {
    const double expected = a * std::pow(1.0 - a, n - 1) / kTick_s;
    REQUIRE(law.update(Vector6d::Unit(2), true, kTick_s).force_N.z() == Approx(expected).epsilon(1e-12));
  }
}

TEST_CASE("D: the filter is stable for any time step", "[wrench_law]") {
  RandomValues random(6);
  WrenchLaw law(damped(WrenchGains::scalar(1.0), 1e6));
  for (int i = 0; i < 1'000; ++i) {
    const double dt_s = random.log_uniform(1e-6, 1e3);
    const Wrench F = law.update(random.unit<6>(), true, dt_s);
    REQUIRE(F.force_N.norm() <= 2.1 / 1e-6);
  }
  for (int i = 0; i < 200; ++i) law.update(Vector6d::Unit(0), true, 1.0);
  CHECK(stacked(law.update(Vector6d::Unit(0), true, 1.0)).norm() < 1e-12);
}

TEST_CASE("a time step that is not positive counts as zero", "[wrench_law]") {
  RandomValues random(7);
  for (const double dt_s : {0.0, -0.0, -1e-3, -1e9}) {
    WrenchGains gains = stiff(full(random));
    gains.integral = full(random);
    gains.damping = full(random);
    WrenchLaw law(gains);
    WrenchLaw untouched(gains);
    const Vector6d eps = random.vector<6>();
    REQUIRE((stacked(law.update(eps, true, dt_s)) - gains.stiffness * eps).norm() <= 1e-13);
    const Vector6d next = random.vector<6>();
    REQUIRE(stacked(law.update(next, true, kTick_s)) == stacked(untouched.update(next, true, kTick_s)));
  }
}

TEST_CASE("leaving contact resets integral and derivative", "[wrench_law]") {
  RandomValues random(8);
  WrenchGains gains = stiff(full(random));
  gains.integral = full(random);
  gains.damping = full(random);
  for (const bool by_reset : {false, true}) {
    WrenchLaw law(gains);
    for (int i = 0; i < 100; ++i) law.update(random.vector<6>(), true, kTick_s);
    if (by_reset)
      law.reset();
    else
      law.update(random.vector<6>(), false, kTick_s);
    WrenchLaw fresh(gains);
    for (int i = 0; i < 20; ++i) {
      const Vector6d eps = random.vector<6>();
      REQUIRE(stacked(law.update(eps, true, kTick_s)) == stacked(fresh.update(eps, true, kTick_s)));
    }
  }
}

TEST_CASE("P, I and D add: Eq. (16)", "[wrench_law]") {
  RandomValues random(9);
  const Matrix6d P = full(random), I = full(random), D = full(random);
  WrenchGains gains = integral(I);
  gains.stiffness = P;
  gains.damping = D;
  WrenchLaw all(gains), p(stiff(P)), i(integral(I)), d(damped(D, gains.derivative_cutoff_Hz));
  for (int tick = 0; tick < 200; ++tick) {
    const Vector6d eps = random.vector<6>();
    const double dt_s = random.log_uniform(1e-4, 1e-2);
    const Vector6d sum = stacked(p.update(eps, true, dt_s)) + stacked(i.update(eps, true, dt_s)) +
                         stacked(d.update(eps, true, dt_s));
    REQUIRE((stacked(all.update(eps, true, dt_s)) - sum).norm() <= 1e-12 * (1.0 + sum.norm()));
  }
}

TEST_CASE("the torque of the translational method uses the gain of its force", "[wrench_law]") {
  WrenchGains gains;
  gains.stiffness = WrenchGains::blockwise(200.0, 5.0);
  gains.integral = WrenchGains::blockwise(30.0, 0.5);
  gains.damping = WrenchGains::blockwise(4.0, 0.1);
  gains.integral_limit_N = 3.0;
  gains.integral_limit_Nm = 0.3;
  gains.derivative_cutoff_Hz = 55.0;
  const WrenchGains translational = gains_for(Method::translational, gains);
  CHECK(translational.stiffness == WrenchGains::scalar(200.0));
  CHECK(translational.integral == WrenchGains::scalar(30.0));
  CHECK(translational.damping == WrenchGains::scalar(4.0));
  CHECK(translational.integral_limit_N == 3.0);
  CHECK(translational.integral_limit_Nm == 0.3);
  CHECK(translational.derivative_cutoff_Hz == 55.0);
  gains.stiffness.diagonal() << 100.0, 200.0, 300.0, 1.0, 2.0, 3.0;  // the mean of three gains
  CHECK(gains_for(Method::translational, gains).stiffness == WrenchGains::scalar(200.0));
  for (const Method method : {Method::exact, Method::planar}) {
    const WrenchGains same = gains_for(method, gains);
    CHECK(same.stiffness == gains.stiffness);
    CHECK(same.integral == gains.integral);
    CHECK(same.damping == gains.damping);
  }
}

TEST_CASE("the spatial wrench is Ad_(p^-1)' W_T, METHOD (66)", "[wrench_law]") {
  RandomValues random(10);
  for (int i = 0; i < 5'000; ++i) {
    const Pose p = random.pose();
    const Wrench W_T = random.wrench();
    const Vector6d W_S = adjoint(inverse(p)).transpose() * stacked(W_T);
    REQUIRE((stacked(spatial_wrench(p, W_T)) - W_S).norm() <= 2e-14 * (1.0 + W_S.norm()));
  }
}

TEST_CASE("the wrench about a point is the spatial wrench moved to it", "[wrench_law]") {
  RandomValues random(11);
  for (int i = 0; i < 5'000; ++i) {
    const Pose p = random.pose();
    const Wrench W_T = random.wrench();
    const Vector3d c_W = random.vector<3>();
    const Vector6d from_spatial = stacked(shifted(spatial_wrench(p, W_T), c_W));
    REQUIRE((stacked(wrench_about(c_W, p, W_T)) - from_spatial).norm() <=
            2e-14 * (1.0 + from_spatial.norm()));
    // About the origin of the body only the axes differ.
    const Vector6d own = stacked(expressed(p.rotation, W_T));
    REQUIRE((stacked(wrench_about(p.translation_m, p, W_T)) - own).norm() == 0.0);
  }
}

TEST_CASE("the work of a wrench does not depend on its point", "[wrench_law]") {
  RandomValues random(12);
  for (int i = 0; i < 2'000; ++i) {
    const Pose p = random.pose();
    const Wrench W_T = random.wrench();
    const Vector6d V_T = random.vector<6>();
    const Vector6d V_S = adjoint(p) * V_T;  // body twist to spatial twist
    REQUIRE(stacked(spatial_wrench(p, W_T)).dot(V_S) == Approx(stacked(W_T).dot(V_T)).margin(5e-14));
  }
}

}  // namespace wrenchd::test_wrench_law
