// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/undriven_motion.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_undriven_motion {

using namespace wrenchd::test;

namespace {

constexpr double kStiffness_N_per_m = 600.0;
constexpr double kTick_s = 1e-3;
constexpr double kDelay_s = 2e-3;

/// A stick held at H whose tip, at p_HC, presses into the floor z = 0 against a spring.
SpringState stick_on_floor(const Pose& X_BH) {
  const Vector3d p_HC_B = X_BH.rotation * Vector3d(0.03, 0.01, -0.02);
  const double depth_m = -(X_BH.translation_m.z() + p_HC_B.z());
  SpringState spring;
  if (depth_m <= 0.0) return spring;
  spring.U_J = 0.5 * kStiffness_N_per_m * depth_m * depth_m;
  spring.F_B.force_N = kStiffness_N_per_m * depth_m * Vector3d::UnitZ();
  spring.F_B.torque_Nm = p_HC_B.cross(spring.F_B.force_N);
  return spring;
}

/// Bounds the curvature of stick_on_floor() in all directions, for depths up to 10 mm.
Matrix6d curvature() {
  Vector6d diagonal;
  const double angular = kStiffness_N_per_m * (0.038 * 0.038 + 0.010 * 0.038);
  diagonal << Vector3d::Constant(2.0 * kStiffness_N_per_m), Vector3d::Constant(2.0 * angular);
  return diagonal.asDiagonal();
}

UndrivenMotion device(DofMask senses, DofMask drives) {
  UndrivenMotion undriven(senses, drives, {});
  undriven.set_loop(curvature(), kDelay_s);
  return undriven;
}

/// The handle and its energy ledger: a force acts over the motion that begins `delay` ticks after its sample.
/// Spring-like delay is subtracted as in METHOD (81), so only undriven motion can make the ledger positive.
struct Ledger {
  DofMask drives;
  std::size_t delay_ticks = 0;
  std::vector<Wrench> sent;
  std::vector<Vector6d> steps;
  Pose X_last;
  double work_J = 0.0, late_J = 0.0, worst_J = 0.0;

  void add(const Pose& X_BH, const Wrench& F_B) {
    if (!sent.empty()) {
      Vector6d d;
      d << X_BH.translation_m - X_last.translation_m,
          rotation_vector(X_BH.rotation * X_last.rotation.conjugate());
      for (unsigned i = 0; i < 6; ++i)
        if ((drives >> i & 1u) == 0) d[i] = 0.0;
      steps.push_back(d);
      const Matrix6d K = curvature();
      late_J += 0.5 * d.dot(K * d);
      for (std::size_t j = 1; j <= delay_ticks && j < steps.size(); ++j) {
        const Vector6d& before = steps[steps.size() - 1 - j];
        late_J += std::sqrt(d.dot(K * d) * before.dot(K * before));
      }
      if (sent.size() > delay_ticks) {
        const Wrench& F = sent[sent.size() - 1 - delay_ticks];
        work_J += F.force_N.dot(d.head<3>()) + F.torque_Nm.dot(d.tail<3>());
      }
      worst_J = std::max(worst_J, work_J - late_J);
    }
    sent.push_back(restrict_to_dofs(F_B, drives));
    X_last = X_BH;
  }
};

/// 4 mm and 0.3 rad from side to side, once a second; forward: in the sense in which the path gives energy.
Pose on_loop(double t_s, bool forward) {
  const double angle = 2.0 * std::numbers::pi * t_s * (forward ? 1.0 : -1.0);
  Pose X;
  X.translation_m.z() = 0.017 + 0.002 * std::sin(angle);
  X.rotation = rotation_from({0.0, 0.15 * std::cos(angle), 0.0});
  return X;
}

/// Approaches the loop from free space, then goes round it. Returns the ledger; min_share: least ratio of the
/// force to that at the measured pose after the approach.
Ledger go_round(UndrivenMotion& undriven, DofMask drives, bool forward, double& min_share,
                std::size_t delay_ticks = 0, int rounds = 3) {
  Ledger ledger{drives, delay_ticks, {}, {}, {}, 0.0, 0.0, 0.0};
  min_share = 1.0;
  for (int i = -500; i < rounds * 1000; ++i) {
    const double t_s = i * kTick_s;
    Pose X = on_loop(std::max(t_s, 0.0), forward);
    X.translation_m.z() += 0.02 * std::max(-2.0 * t_s, 0.0);
    SpringState last, before;
    const auto render = [&](const Pose& at) {
      before = last;
      return last = stick_on_floor(at);
    };
    undriven.follow(X, t_s, render, [&] { last = before; });
    ledger.add(X, last.F_B);
    const double whole_N = stick_on_floor(X).F_B.force_N.norm();
    if (i > 0 && whole_N > 0.0) min_share = std::min(min_share, last.F_B.force_N.norm() / whole_N);
  }
  return ledger;
}

}  // namespace

TEST_CASE("a device that drives all axes it senses gets its own pose, and one projection", "[undriven]") {
  RandomValues random(1);
  const DofMask masks[][2] = {{kAllDofs, kAllDofs}, {kLinearDofs, kLinearDofs}, {kAllDofs, kNoDof}};
  for (const auto& [senses, drives] : masks) {
    UndrivenMotion undriven = device(senses, drives);
    CHECK(!undriven.active());
    for (int i = 0; i < 100; ++i) {
      Pose X = {random.rotation(), random.vector<3>(0.02)};
      int calls = 0;
      const Pose used = undriven.follow(X, i * kTick_s, [&](const Pose& at) {
        ++calls;
        return stick_on_floor(at);
      });
      CHECK(used.translation_m == X.translation_m);
      CHECK(calls == 1);
      if (drives != kAllDofs) CHECK(same_bits(used, X));
    }
  }
}

TEST_CASE("no closed path of the hand gives work if only three forces are driven", "[undriven]") {
  for (const DofMask drives : {kLinearDofs, static_cast<DofMask>(kAllDofs & ~0b010'000)}) {
    for (const bool forward : {false, true}) {
      for (const std::size_t delay_ticks : {0, 1, 2}) {
        INFO("drives " << int{drives} << ", forward " << forward << ", delay " << delay_ticks);
        UndrivenMotion undriven = device(kAllDofs, drives);
        double share = 0.0;
        CHECK(go_round(undriven, drives, forward, share, delay_ticks).worst_J < 1e-6);
        CHECK(undriven.account_J() > -1e-6);
      }
    }
  }
}

TEST_CASE("with the measured rotation the same path gives work in one sense", "[undriven]") {
  double best_J = 0.0;
  for (const bool forward : {false, true}) {
    UndrivenMotion measured = device(kNoDof, kLinearDofs);  // inactive: renders the measured pose
    double share = 0.0;
    best_J = std::max(best_J, go_round(measured, kLinearDofs, forward, share).worst_J);
    CHECK(share == 1.0);
  }
  CHECK(best_J > 1e-3);
}

TEST_CASE("without contact the rendering follows the hand exactly", "[undriven]") {
  RandomValues random(2);
  UndrivenMotion undriven = device(kAllDofs, kLinearDofs);
  for (int i = 0; i < 100; ++i) {
    const Pose X = {random.rotation(0.5), Vector3d(0.0, 0.0, 0.1) + random.vector<3>(0.02)};
    const Pose used = undriven.follow(X, i * kTick_s, stick_on_floor);
    CHECK(used.translation_m == X.translation_m);
    CHECK(rotation_vector(used.rotation * X.rotation.conjugate()).norm() < 1e-12);
  }
}

TEST_CASE("a rotation that lowers the potential is followed, and pays for one that raises it", "[undriven]") {
  UndrivenMotion undriven = device(kAllDofs, kLinearDofs);
  Pose X;
  X.translation_m.z() = 0.03;
  for (int i = 0; i < 200; ++i) {  // presses 5 mm deep, without rotation
    X.translation_m.z() = 0.03 - 0.015 * i / 199.0;
    undriven.follow(X, i * kTick_s, stick_on_floor);
  }
  const double pressed_J = stick_on_floor(X).U_J;
  REQUIRE(pressed_J > 1e-3);
  for (int i = 0; i < 200; ++i) {  // turns the tip up, out of the floor
    X.rotation = rotation_from({0.0, -0.1 * i / 199.0, 0.0});
    undriven.follow(X, 0.2 + i * kTick_s, stick_on_floor);
    CHECK(undriven.lag_rad() < 1e-9);
  }
  const double left_J = stick_on_floor(X).U_J;
  CHECK(undriven.account_J() == Approx(pressed_J - left_J).epsilon(0.01));
  for (int i = 0; i < 400; ++i) {  // turns it down again, twice as far
    X.rotation = rotation_from({0.0, -0.1 + 0.2 * i / 399.0, 0.0});
    undriven.follow(X, 0.4 + i * kTick_s, stick_on_floor);
    if (i < 190) CHECK(undriven.lag_rad() < 1e-9);
  }
  CHECK(undriven.lag_rad() == Approx(0.1).epsilon(0.1));  // the account paid for the way back, not for more
  CHECK(undriven.account_J() < 2e-6);
}

TEST_CASE("undriven motion waits while the potential is not known", "[undriven]") {
  UndrivenMotion undriven = device(kAllDofs, kLinearDofs);
  Pose X;
  X.translation_m.z() = 0.05;
  undriven.follow(X, 0.0, stick_on_floor);
  X.rotation = rotation_from({0.0, 0.1, 0.0});
  undriven.follow(X, 1e-3, [](const Pose& at) {
    SpringState spring = stick_on_floor(at);
    spring.known = false;
    return spring;
  });
  CHECK(undriven.lag_rad() == Approx(0.1));
  undriven.follow(X, 2e-3, stick_on_floor);
  CHECK(undriven.lag_rad() < 1e-12);
}

// A proxy that follows a rotation round an edge does not come back by the same way: at the old pose it is on
// the other side of the edge, with a loaded spring.
TEST_CASE("a rotation that costs too much leaves no trace", "[undriven]") {
  UndrivenMotion undriven = device(kAllDofs, kLinearDofs);
  bool round_the_edge = false, before = false;
  const auto render = [&](const Pose& at) {
    before = round_the_edge;
    round_the_edge = round_the_edge || rotation_vector(at.rotation).norm() > 0.2;
    SpringState spring;
    spring.U_J = round_the_edge ? 0.05 : 0.0;
    return spring;
  };
  const auto undo = [&] { round_the_edge = before; };
  Pose X;
  undriven.follow(X, 0.0, render, undo);
  X.rotation = rotation_from({0.0, 0.5, 0.0});
  undriven.follow(X, kTick_s, render, undo);
  CHECK_FALSE(round_the_edge);
  CHECK(undriven.account_J() >= 0.0);
  CHECK(undriven.lag_rad() > 0.2);
}

TEST_CASE("no energy counts while no force reaches the hand", "[undriven]") {
  UndrivenMotion undriven = device(kAllDofs, kLinearDofs);
  undriven.set_share(0.0);
  Pose X;
  X.translation_m.z() = 0.01;
  for (int i = 0; i < 100; ++i) {
    X.rotation = rotation_from({0.0, 0.003 * i, 0.0});
    undriven.follow(X, i * kTick_s, stick_on_floor);
    CHECK(undriven.lag_rad() < 1e-9);
  }
  CHECK(undriven.account_J() == 0.0);
}

}  // namespace wrenchd::test_undriven_motion
