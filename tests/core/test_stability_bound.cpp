// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "core/energy_law.hpp"
#include "core/stability_bound.hpp"
#include "core/wrench_law.hpp"
#include "devices/simulation/simulated_handle.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_stability_bound {

using test::RandomValues;

namespace {

constexpr DeviceDamping kDevice{0.5, 0.002};

Coupling spring(double linear, double angular) {
  return {WrenchGains::blockwise(linear, angular), Matrix6d::Zero()};
}

/// A free handle of 0.15 kg with friction of 0.5 N.s/m on a sampled, delayed spring along x. Returns its
/// energy after 4 s divided by its initial energy.
double swing_left(double K_N_per_m, const LoopDelay& loop) {
  constexpr int kSubsteps = 100;
  SimulationSettings s;
  s.viscous_friction_N_s_per_m = 0.5;
  s.viscous_friction_Nm_s_per_rad = 0.002;
  s.hand_stiffness_N_per_m = s.hand_stiffness_Nm_per_rad = 0.0;
  s.hand_damping_N_s_per_m = s.hand_damping_Nm_s_per_rad = 0.0;
  s.actuator_max_force_N = 1e300;
  const double h = loop.period_s / kSubsteps;
  SimulatedHandle handle(s, {Quaterniond::Identity(), {1e-3, 0.0, 0.0}}, h);
  std::deque<double> under_way(static_cast<std::size_t>(std::lround(loop.delay_s / h)), 0.0);
  Wrench motors;
  double held = 0.0;
  const auto energy = [&] {
    return handle.kinetic_energy_J() + 0.5 * K_N_per_m * handle.X_BH().translation_m.squaredNorm();
  };
  const double start_J = energy();
  for (long i = 0; i < std::lround(4.0 / h) && energy() < 1e6 * start_J; ++i) {
    if (i % kSubsteps == 0) held = -K_N_per_m * handle.X_BH().translation_m.x();
    under_way.push_back(held);
    motors.force_N.x() = under_way.front();
    under_way.pop_front();
    handle.step({}, motors);
  }
  return energy() / start_J;
}

}  // namespace

TEST_CASE("the stiffness bound agrees with a simulated handle, for any rate and delay", "[stability_bound]") {
  struct Case {
    LoopDelay loop;
    double most_N_per_m;
  };
  for (const auto& [loop, most] :
       {Case{{1e-3, 0.0}, 1000.0}, Case{{1e-3, 1e-3}, 1000.0 / 3.0}, Case{{1e-3, 2e-3}, 200.0},
        Case{{1e-3, 3e-3}, 1000.0 / 7.0}, Case{{0.25e-3, 0.5e-3}, 800.0}}) {
    INFO("T " << loop.period_s << " s, tau " << loop.delay_s << " s");
    const StabilityBound bound = stability_bound(kDevice, loop, spring(0.0, 0.0), {});
    CHECK(bound.max_stiffness_N_per_m == Approx(most).epsilon(1e-12));
    CHECK(bound.max_stiffness_Nm_per_rad == Approx(most * 0.002 / 0.5).epsilon(1e-12));
    // 3 % below the bound is stable, 3 % above it unstable; substeps of the plant contribute 1 %.
    CHECK(swing_left(0.97 * most, loop) < 1.0);
    CHECK(swing_left(1.03 * most, loop) > 1.0);
  }
}

TEST_CASE("a spring and damper are scaled to the bound", "[stability_bound]") {
  const LoopDelay loop{1e-3, 1e-3};  // T/2 + tau = 1.5 ms
  SECTION("within the bound nothing is scaled") {
    CHECK(stability_bound(kDevice, loop, spring(300.0, 1.0), {}).scale == 1.0);
  }
  SECTION("the linear half decides") {
    CHECK(stability_bound(kDevice, loop, spring(1000.0, 0.5), {}).scale == Approx(1.0 / 3.0));
  }
  SECTION("the angular half decides") {
    CHECK(stability_bound(kDevice, loop, spring(100.0, 4.0), {}).scale == Approx(1.0 / 3.0));
  }
  SECTION("virtual damping counts against it") {
    Coupling coupling = spring(200.0, 0.1);
    coupling.damping = WrenchGains::blockwise(0.7, 0.0);
    const StabilityBound bound = stability_bound(kDevice, loop, coupling, {});
    CHECK(bound.scale == Approx(0.5 / (0.3 + 0.7)));
    CHECK(bound.scale_undamped == 1.0);
    CHECK(bound.max_stiffness_N_per_m == 0.0);  // the damper alone exceeds the bound
    coupling.damping = WrenchGains::blockwise(0.2, 0.0);
    CHECK(stability_bound(kDevice, loop, coupling, {}).max_stiffness_N_per_m == Approx(0.3 / 1.5e-3));
  }
  SECTION("a device without friction bears nothing") {
    CHECK(stability_bound({0.0, 0.002}, loop, spring(1.0, 0.0), {}).scale == 0.0);
    CHECK(stability_bound({0.0, 0.002}, loop, spring(0.0, 1.0), {}).scale == 1.0);
  }
}

TEST_CASE("a lever to the tool increases the rotational stiffness", "[stability_bound]") {
  // A linear spring at the end of a lever l has the rotational stiffness K l^2. b_rot / (K l^2) is the
  // tightest bound; the coupling of translation and rotation reduces it slightly.
  const LoopDelay loop{1e-3, 0.5e-3};  // T/2 + tau = 1 ms
  const double l = 0.1, K = 300.0;
  const Pose X_HT{Quaterniond::Identity(), {l, 0.0, 0.0}};
  // In the plane of the lever: B^-1/2 K (1, l)(1, l)' B^-1/2 has one eigenvalue, K (1/b + l^2/b_rot).
  CHECK(stability_bound(kDevice, loop, spring(K, 0.0), X_HT).scale ==
        Approx(1.0 / (1e-3 * K * (1.0 / 0.5 + l * l / 0.002))));
}

TEST_CASE("the scaled coupling just satisfies the inequality, for any lever", "[stability_bound]") {
  RandomValues random(11);
  for (int n = 0; n < 50; ++n) {
    const Pose X_HT = random.pose(0.05);
    const Matrix6d A = 30.0 * Matrix6d::NullaryExpr([&] { return random.normal(); });
    const Matrix6d C = Matrix6d::NullaryExpr([&] { return random.normal(); });
    const Coupling coupling{A * A.transpose(), 0.1 * C * C.transpose()};
    const LoopDelay loop{1e-3, random.uniform(0.0, 3e-3)};
    const double s = stability_bound(kDevice, loop, coupling, X_HT).scale;
    REQUIRE(s > 0.0);
    REQUIRE(s < 1.0);
    // Compared with powers of random twists of the handle; the twist of the tool is computed independently.
    const double lag_s = 0.5 * loop.period_s + loop.delay_s;
    const auto taken = [&](const Twist& V_H) {
      return 0.5 * V_H.linear_m_per_s.squaredNorm() + 0.002 * V_H.angular_rad_per_s.squaredNorm();
    };
    const auto given = [&](const Twist& V_H) {
      const Twist V_T = expressed(X_HT.rotation.conjugate(), shifted(V_H, X_HT.translation_m));
      Vector6d v;
      v << V_T.linear_m_per_s, V_T.angular_rad_per_s;
      return s * (lag_s * v.dot(coupling.stiffness * v) + v.dot(coupling.damping * v));
    };
    double nearest = 0.0;
    for (int m = 0; m < 200; ++m) {
      const Twist V_H{random.vector<3>(), random.log_uniform(0.1, 100.0) * random.unit<3>()};
      CHECK(given(V_H) <= taken(V_H) * (1.0 + 1e-9));
      nearest = std::max(nearest, given(V_H) / taken(V_H));
    }
    CHECK(nearest > 0.2);
  }
}

TEST_CASE("a device without motors needs no bound", "[stability_bound]") {
  const LoopDelay loop{1e-3, 1e-3};
  const DeviceDamping force_only{0.5, DeviceProfile::kNotStated};
  const StabilityBound bound = stability_bound(force_only, loop, spring(200.0, 1e6), {}, kLinearDofs);
  CHECK(bound.scale == 1.0);
  CHECK(bound.max_stiffness_Nm_per_rad == std::numeric_limits<double>::infinity());
  CHECK_THROWS_WITH(stability_bound(force_only, loop, spring(200.0, 1.0), {}),
                    Catch::Contains("damping_Nm_s_per_rad"));
}

TEST_CASE("the encoder step can be the tightest bound", "[stability_bound]") {
  const LoopDelay loop{0.5e-3, 0.0};
  const DeviceDamping much{50.0, 0.5};
  const StabilityBound fine = stability_bound(much, loop, spring(5000.0, 5.0), {});
  CHECK(fine.scale == 1.0);
  // K step^2 / 4 limits the energy of an encoder step: 200 N/m at 100 um.
  const StabilityBound coarse =
      stability_bound(much, loop, spring(5000.0, 5.0), {}, kAllDofs, {100e-6, 1e-3});
  CHECK(coarse.max_stiffness_N_per_m == Approx(200.0));
  CHECK(coarse.max_stiffness_Nm_per_rad == Approx(2.0));
  CHECK(coarse.scale == Approx(0.04));
  CHECK(coarse.scale_undamped == Approx(0.04));
  // Encoder steps of undriven axes have no effect.
  const StabilityBound turned =
      stability_bound(much, loop, spring(5000.0, 5.0), {}, kAngularDofs, {100e-6, 1e-3});
  CHECK(turned.scale == Approx(0.4));
  CHECK_THROWS_WITH(stability_bound(much, loop, spring(1.0, 1.0), {}, kAllDofs, {-1e-6, 0.0}),
                    Catch::Contains("encoder's step"));
}

TEST_CASE("the bound rejects invalid inputs by name", "[stability_bound]") {
  const LoopDelay loop{1e-3, 1e-3};
  CHECK_THROWS_WITH(stability_bound({}, loop, spring(1.0, 1.0), {}), Catch::Contains("damping_N_s_per_m"));
  CHECK_THROWS_WITH(stability_bound({-0.1, 0.1}, loop, spring(1.0, 1.0), {}), Catch::Contains("0 or more"));
  CHECK_THROWS_WITH(stability_bound(kDevice, {0.0, 0.0}, spring(1.0, 1.0), {}), Catch::Contains("period"));
  CHECK_THROWS_WITH(stability_bound(kDevice, {1e-3, -1e-3}, spring(1.0, 1.0), {}), Catch::Contains("delay"));
  CHECK_THROWS_WITH(stability_bound(kDevice, loop, spring(-1.0, 1.0), {}), Catch::Contains("stiffness"));
  CHECK_THROWS_WITH(stability_bound(kDevice, loop, spring(std::nan(""), 1.0), {}),
                    Catch::Contains("not finite"));
  Coupling coupling = spring(1.0, 1.0);
  coupling.damping(4, 4) = -1.0;
  CHECK_THROWS_WITH(stability_bound(kDevice, loop, coupling, {}), Catch::Contains("damping"));
}

TEST_CASE("the stiffness of the energy law is its derivative at the equilibrium", "[stability_bound]") {
  RandomValues random(12);
  for (int n = 0; n < 20; ++n) {
    const Inertia M = random.inertia(0.1);
    const Matrix6d K = energy_stiffness(M, 3000.0);
    const Vector6d xi = 1e-6 * random.vector<6>();
    const Wrench F = energy_wrench(M, 3000.0, {}, exp(xi));
    Vector6d numbers;
    numbers << F.force_N, F.torque_Nm;
    CHECK((numbers - K * xi).norm() <= 1e-5 * numbers.norm());
  }
}

TEST_CASE("stiffness and damping along axes without motors do not change the bound", "[stability_bound]") {
  RandomValues random(13);
  const LoopDelay loop{1e-3, 1e-3};
  const auto without = [](Matrix6d K, DofMask driven) {
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        if ((driven >> i & 1) == 0 || (driven >> j & 1) == 0) K(i, j) = 0.0;
    return K;
  };
  for (const DofMask driven : {kLinearDofs, kAngularDofs, static_cast<DofMask>(0b011010)})
    for (int n = 0; n < 20; ++n) {
      const Matrix6d A = 20.0 * Matrix6d::NullaryExpr([&] { return random.normal(); });
      const Matrix6d C = 0.3 * Matrix6d::NullaryExpr([&] { return random.normal(); });
      const Coupling all{A * A.transpose(), C * C.transpose()};
      const Coupling block{without(all.stiffness, driven), without(all.damping, driven)};
      const StabilityBound a = stability_bound(kDevice, loop, all, {}, driven, {100e-6, 1e-3});
      const StabilityBound b = stability_bound(kDevice, loop, block, {}, driven, {100e-6, 1e-3});
      CHECK(a.scale == Approx(b.scale).epsilon(1e-9));
      CHECK(a.scale_undamped == Approx(b.scale_undamped).epsilon(1e-9));
      CHECK(a.scale < 1.0);
      CHECK(a.max_stiffness_N_per_m == b.max_stiffness_N_per_m);
      CHECK(a.max_stiffness_Nm_per_rad == b.max_stiffness_Nm_per_rad);
    }
}

TEST_CASE("the stiffest spring beside a damper just satisfies the inequality", "[stability_bound]") {
  RandomValues random(14);
  const LoopDelay loop{1e-3, 1.5e-3};  // T/2 + tau = 2 ms
  for (int n = 0; n < 20; ++n) {
    const Pose X_HT = random.pose(0.02);
    Coupling coupling = spring(0.0, 0.0);
    coupling.damping = WrenchGains::blockwise(random.uniform(0.0, 0.2), random.uniform(0.0, 5e-4));
    const StabilityBound bound = stability_bound(kDevice, loop, coupling, X_HT);
    for (const bool linear : {true, false}) {
      const double most = linear ? bound.max_stiffness_N_per_m : bound.max_stiffness_Nm_per_rad;
      REQUIRE(most > 0.0);
      for (const double share : {0.999, 1.001}) {
        coupling.stiffness =
            linear ? spring(share * most, 0.0).stiffness : spring(0.0, share * most).stiffness;
        CHECK((stability_bound(kDevice, loop, coupling, X_HT).scale == 1.0) == (share < 1.0));
      }
    }
  }
}

}  // namespace wrenchd::test_stability_bound
