// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "core/cone_projection.hpp"
#include "core/least_distance.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_cone_projection {

namespace {

using Cones = std::vector<FrictionCone>;

struct RandomProblem {
  test::RandomValues random;
  FrictionCone::Block block(const Vector3d& lever) {
    FrictionCone::Block D;
    D << Matrix3d::Identity(), -hat(lever);
    return D;
  }
  /// z = 0 obeys every cone.
  Cones cones(std::size_t bodies, std::size_t count, double mu) {
    Cones out(count);
    for (FrictionCone& cone : out) {
      cone.a = random.bits() % bodies;
      cone.b = random.bits() % (bodies + 1);
      cone.D_a = block(random.vector<3>());
      if (cone.b == cone.a || cone.b == bodies)
        cone.b = FrictionCone::kFixed;
      else
        cone.D_b = -block(random.vector<3>());
      cone.n = random.unit<3>();
      cone.mu = mu;
      const Vector3d slip = random.vector<3>(0.1);
      cone.slip_m = slip - cone.n.dot(slip) * cone.n;
      cone.h_m = mu * cone.slip_m.norm() + std::max(0.0, 0.3 * random.normal());
    }
    return out;
  }
};

/// What a solved problem says about one cone.
struct Answer {
  Vector3d force;
  double load;
  Vector3d moved, slip;
};

Answer answer_of(const ConeProjection& problem, const FrictionCone& cone, std::size_t k) {
  Vector3d moved = cone.D_a * problem.z(cone.a);
  if (cone.b != FrictionCone::kFixed) moved += cone.D_b * problem.z(cone.b);
  const Vector3d force = problem.force(k);
  return {force, cone.n.dot(force), moved, moved - cone.n.dot(moved) * cone.n + cone.slip_m};
}

/// The forces of the cones move each body from z0 to its answer.
void check_balance(const ConeProjection& problem, const Cones& cones, const std::vector<Vector6d>& z0) {
  std::vector<Vector6d> rest(z0.size());
  for (std::size_t i = 0; i < z0.size(); ++i) rest[i] = problem.z(i) - z0[i];
  for (std::size_t k = 0; k < cones.size(); ++k) {
    rest[cones[k].a] -= cones[k].D_a.transpose() * problem.force(k);
    if (cones[k].b != FrictionCone::kFixed) rest[cones[k].b] -= cones[k].D_b.transpose() * problem.force(k);
  }
  for (const Vector6d& one : rest) CHECK(one.norm() < 1e-8);
}

/// The conditions that only the answer of a convex problem fulfils.
void check_optimal(const ConeProjection& problem, const Cones& cones, const std::vector<Vector6d>& z0) {
  check_balance(problem, cones, z0);
  for (std::size_t k = 0; k < cones.size(); ++k) {
    const FrictionCone& cone = cones[k];
    const auto [force, load, moved, slip] = answer_of(problem, cone, k);
    CHECK(cone.n.dot(moved) + cone.h_m >= cone.mu * slip.norm() - 1e-9);
    CHECK((force - load * cone.n).norm() <= cone.mu * load + 1e-9);  // Coulomb's cone
    CHECK(std::abs(force.dot(moved) + load * cone.h_m + (force - load * cone.n).dot(cone.slip_m)) < 1e-7);
  }
}

TEST_CASE("the answer is the nearest step in all cones", "[cone_projection]") {
  RandomProblem made{test::RandomValues(5)};
  for (int k = 0; k < 200; ++k) {
    const std::size_t bodies = 1 + made.random.bits() % 5;
    const Cones cones =
        made.cones(bodies, 1 + made.random.bits() % (4 * bodies), k % 4 == 0 ? 0.0 : 0.2 * (k % 5));
    ConeProjection problem(bodies, cones.size());
    std::vector<Vector6d> z0(bodies);
    for (Vector6d& one : z0) one = made.random.vector<6>();
    std::vector<StaticVector<Vector3d, 4>> known(cones.size());
    for (const bool again : {false, true}) {
      INFO("problem " << k << (again ? ", again" : ""));
      problem.clear(bodies);
      for (std::size_t i = 0; i < bodies; ++i) problem.z0(i) = z0[i];
      for (const FrictionCone& cone : cones) REQUIRE(problem.add(cone));
      for (std::size_t i = 0; i < cones.size(); ++i)
        for (const Vector3d& normal : known[i]) problem.suggest(i, normal);
      REQUIRE(problem.solve(1e-11) == ConeProjection::Status::optimal);
      check_optimal(problem, cones, z0);
      if (again) CHECK(problem.steps() <= 2);  // the half-spaces of the answer are known
      for (std::size_t i = 0; i < cones.size(); ++i) known[i] = problem.active_normals(i);
    }
  }
}

/// Coulomb's law: no gap is negative, what is loaded has none, and friction is within its cone, opposite to
/// the slip.
void check_coulomb(const ConeProjection& problem, const Cones& cones, const std::vector<Vector6d>& z0) {
  check_balance(problem, cones, z0);
  for (std::size_t k = 0; k < cones.size(); ++k) {
    const FrictionCone& cone = cones[k];
    const auto [force, load, moved, slip] = answer_of(problem, cone, k);
    const double gap_m = cone.n.dot(moved) + cone.h_m;
    INFO("cone " << k << ", gap " << gap_m << ", load " << load << ", slip " << slip.norm());
    CHECK(gap_m >= -1e-9);
    CHECK(load >= -1e-9);
    CHECK(std::abs(gap_m) * load < 1e-8);
    const Vector3d friction = force - load * cone.n;
    CHECK(friction.norm() <= cone.mu * load + 1e-8);
    CHECK(std::abs(friction.dot(slip) + cone.mu * load * slip.norm()) < 1e-7);
    CHECK(problem.lift_m(k) == Approx(cone.mu * slip.norm()).margin(1e-12));
  }
}

TEST_CASE(
    "with the lifts of Coulomb's law the gaps of loaded cones are closed, and friction opposes the slip",
    "[cone_projection]") {
  RandomProblem made{test::RandomValues(8)};
  int answered = 0;
  constexpr int kProblems = 200;
  for (int k = 0; k < kProblems; ++k) {
    const std::size_t bodies = 1 + made.random.bits() % 5;
    const Cones cones = made.cones(bodies, 1 + made.random.bits() % (4 * bodies), 0.1 * (1 + k % 5));
    ConeProjection problem(bodies, cones.size());
    problem.clear(bodies);
    std::vector<Vector6d> z0(bodies);
    for (std::size_t i = 0; i < bodies; ++i) problem.z0(i) = z0[i] = made.random.vector<6>();
    for (const FrictionCone& cone : cones) REQUIRE(problem.add(cone));
    INFO("problem " << k);
    if (problem.solve_coulomb(1e-11) != ConeProjection::Status::optimal) continue;
    ++answered;
    check_coulomb(problem, cones, z0);
  }
  CHECK(answered > 0.9 * kProblems);
}

TEST_CASE("without friction the answer is that of LeastDistance", "[cone_projection]") {
  RandomProblem made{test::RandomValues(6)};
  for (int k = 0; k < 50; ++k) {
    const Cones cones = made.cones(1, 8, 0.0);
    ConeProjection problem(1, cones.size());
    LeastDistance<6, 8> reference;
    problem.clear(1);
    const Vector6d z0 = made.random.vector<6>();
    problem.z0(0) = z0;
    for (const FrictionCone& cone : cones) {
      problem.add(cone);
      reference.add(cone.D_a.transpose() * cone.n, -cone.h_m);
    }
    REQUIRE(reference.solve(z0, 1e-13) == LeastDistance<6, 8>::Status::optimal);
    REQUIRE(problem.solve(1e-13) == ConeProjection::Status::optimal);
    CHECK((problem.z(0) - reference.z()).norm() < 1e-9);
  }
}

TEST_CASE("cones that contradict each other are infeasible", "[cone_projection]") {
  ConeProjection problem(1, 2);
  problem.clear(1);
  problem.z0(0).setZero();
  FrictionCone cone;
  cone.a = 0;
  cone.D_a << Matrix3d::Identity(), Matrix3d::Zero();
  cone.h_m = -1.0;
  problem.add(cone);
  cone.n = -cone.n;
  problem.add(cone);
  CHECK_FALSE(problem.add(cone));  // no room
  CHECK(problem.solve(1e-12) == ConeProjection::Status::infeasible);
}

TEST_CASE("a solve of cones does not allocate", "[cone_projection]") {
  RandomProblem made{test::RandomValues(7)};
  const Cones cones = made.cones(4, 16, 0.5);
  ConeProjection problem(4, cones.size());
  const test::RealtimeGuard guard;
  problem.clear(4);
  for (std::size_t i = 0; i < 4; ++i) problem.z0(i).setConstant(-1.0);
  for (const FrictionCone& cone : cones) problem.add(cone);
  problem.solve(1e-11);
  for (std::size_t i = 0; i < cones.size(); ++i)
    for (const Vector3d& normal : problem.active_normals(i)) problem.suggest(i, normal);
  problem.solve(1e-11);
  problem.solve_coulomb(1e-11);
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace wrenchd::test_cone_projection
