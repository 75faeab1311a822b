// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "core/least_distance.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_least_distance {

using test::RandomValues;

namespace {

constexpr std::size_t kCapacity = 64;
constexpr double kTolerance = 2e-15;  // tolerance of the projection

template <int N>
using Vector = Eigen::Matrix<double, N, 1>;

template <int N>
struct Row {
  Vector<N> b;
  double c;
};

template <int N>
using Rows = std::vector<Row<N>>;

template <int N>
LeastDistance<N, kCapacity> posed(const Rows<N>& rows) {
  LeastDistance<N, kCapacity> problem;
  for (const Row<N>& row : rows) problem.add(row.b, row.c);
  return problem;
}

/// Residuals of the Karush-Kuhn-Tucker conditions, relative to the size of the problem.
struct Violation {
  double stationarity = 0.0;     ///< z - z0 = sum lambda_i b_i
  double primal = 0.0;           ///< b_i . z >= c_i, |b_i| = 1
  double dual = 0.0;             ///< lambda_i >= 0
  double complementarity = 0.0;  ///< lambda_i (b_i . z - c_i) = 0
};

template <int N>
Violation violation(const LeastDistance<N, kCapacity>& solved, const Rows<N>& rows, const Vector<N>& z0) {
  Violation worst;
  Vector<N> residual = solved.z() - z0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double length = rows[i].b.norm();
    const double lambda = solved.multiplier(i) * length;
    const double gap = (rows[i].b.dot(solved.z()) - rows[i].c) / length;
    residual -= lambda * rows[i].b / length;
    worst.primal = std::max(worst.primal, -gap);
    worst.dual = std::max(worst.dual, -lambda);
    worst.complementarity = std::max(worst.complementarity, std::abs(lambda * gap));
  }
  worst.stationarity = residual.norm();
  return worst;
}

template <int N>
void require_optimal(const Rows<N>& rows, const Vector<N>& z0, double rounding) {
  auto problem = posed(rows);
  using Status = typename LeastDistance<N, kCapacity>::Status;
  REQUIRE(problem.solve(z0, kTolerance) == Status::optimal);
  const Violation worst = violation(problem, rows, z0);
  double multipliers = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i)
    multipliers += std::abs(problem.multiplier(i)) * rows[i].b.norm();
  const double scale = 1.0 + z0.norm() + problem.z().norm() + multipliers;
  REQUIRE(worst.primal <= kTolerance + 1e-15 * problem.z().norm());
  REQUIRE(worst.stationarity <= rounding * scale);
  REQUIRE(worst.dual <= rounding * scale);
  REQUIRE(worst.complementarity <= rounding * scale * scale);
}

/// Returns feasible rows: all admit a common point, and many pass through it.
template <int N>
Rows<N> admissible_rows(RandomValues& random, int count, const Vector<N>& inside) {
  Rows<N> rows;
  const Vector<N> out = random.unit<N>();
  while (rows.size() < static_cast<std::size_t>(count)) {
    const Vector<N> direction = random.unit<N>();
    if (direction.dot(out) < 0.05) continue;
    const Vector<N> b = random.log_uniform(1e-3, 1e3) * direction;
    const double slack = random.chance(0.2) ? 0.0 : random.uniform(0.0, 1.0);
    rows.push_back({b, b.dot(inside) - slack * b.norm()});
  }
  return rows;
}

/// Returns the solution by brute force: tries every active set until all conditions hold.
template <int N>
std::optional<Vector<N>> by_enumeration(const Rows<N>& rows, const Vector<N>& z0) {
  constexpr double kSlack = 1e-9;
  std::optional<Vector<N>> best;
  for (unsigned set = 0; set < 1U << rows.size(); ++set) {
    std::vector<Eigen::Index> active;
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (set & 1U << i) active.push_back(static_cast<Eigen::Index>(i));
    const auto k = static_cast<Eigen::Index>(active.size());
    if (k > N) continue;
    Vector<N> z = z0;
    if (k > 0) {
      Eigen::MatrixXd B(k, N);
      Eigen::VectorXd c(k);
      for (Eigen::Index i = 0; i < k; ++i) {
        const Row<N>& row = rows[static_cast<std::size_t>(active[static_cast<std::size_t>(i)])];
        B.row(i) = row.b.normalized().transpose();
        c[i] = row.c / row.b.norm();
      }
      const Eigen::FullPivLU<Eigen::MatrixXd> gram(B * B.transpose());
      if (gram.rcond() < 1e-10) continue;
      const Eigen::VectorXd lambda = gram.solve(c - B * z0);
      if (lambda.minCoeff() < -kSlack) continue;
      z += B.transpose() * lambda;
    }
    bool admissible = true;
    for (const Row<N>& row : rows) admissible = admissible && row.b.dot(z) - row.c >= -kSlack * row.b.norm();
    if (admissible && (!best || (z - z0).norm() < (*best - z0).norm())) best = z;
  }
  return best;
}

template <int N>
void require_same_as_enumeration(const Rows<N>& rows, const Vector<N>& z0) {
  using Status = typename LeastDistance<N, kCapacity>::Status;
  auto problem = posed(rows);
  const Status status = problem.solve(z0, 1e-13);
  const auto expected = by_enumeration(rows, z0);
  for (const Row<N>& row : rows) UNSCOPED_INFO(row.b.transpose() << " >= " << row.c);
  UNSCOPED_INFO("z0 = " << z0.transpose());
  REQUIRE(status == (expected ? Status::optimal : Status::infeasible));
  if (expected) REQUIRE((problem.z() - *expected).norm() <= 1e-8 * (1.0 + expected->norm()));
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("the nearest point meets the optimality conditions over random problems",
                       "[least_distance]", ((int N), N), 3, 6, 7) {
  RandomValues random(1);
  for (int i = 0; i < 5'000; ++i) {
    const Vector<N> inside = random.vector<N>();
    const Rows<N> rows = admissible_rows<N>(random, random.integer(1, 40), inside);
    require_optimal<N>(rows, random.vector<N>(random.log_uniform(0.01, 100.0)), 1e-11);
  }
}

TEST_CASE("a feasible point stays unchanged, bit for bit", "[least_distance]") {
  RandomValues random(2);
  LeastDistance<3, kCapacity> none;
  const Vector3d anywhere = random.vector<3>();
  CHECK(none.solve(anywhere, kTolerance) == LeastDistance<3, kCapacity>::Status::optimal);
  CHECK(none.z() == anywhere);
  for (int i = 0; i < 1'000; ++i) {
    const Vector<6> inside = random.vector<6>();
    const Rows<6> rows = admissible_rows<6>(random, 20, inside);
    auto problem = posed(rows);
    REQUIRE(problem.solve(inside, 1e-13) == LeastDistance<6, kCapacity>::Status::optimal);
    REQUIRE(problem.z() == inside);
    for (std::size_t k = 0; k < rows.size(); ++k) REQUIRE(problem.multiplier(k) == 0.0);
  }
}

TEST_CASE("one row: the foot of the perpendicular", "[least_distance]") {
  RandomValues random(3);
  for (int i = 0; i < 2'000; ++i) {
    const Vector3d b = random.log_uniform(1e-6, 1e6) * random.unit<3>();
    const Vector3d z0 = random.vector<3>();
    const double depth = random.log_uniform(1e-6, 1e3);
    auto problem = posed<3>({{b, b.dot(z0) + depth * b.norm()}});
    REQUIRE(problem.solve(z0, kTolerance) == LeastDistance<3, kCapacity>::Status::optimal);
    REQUIRE((problem.z() - z0 - depth * b.normalized()).norm() <= 1e-14 * (1.0 + depth + z0.norm()));
    REQUIRE(problem.multiplier(0) == Approx(depth / b.norm()).epsilon(1e-9));
  }
}

TEST_CASE("a corner: the nearest point of a box is the point clamped to it", "[least_distance]") {
  RandomValues random(4);
  const Vector<6> half = Vector<6>::Constant(0.5);
  Rows<6> box;
  for (int axis = 0; axis < 6; ++axis) {
    box.push_back({Vector<6>::Unit(axis), -0.5});
    box.push_back({-Vector<6>::Unit(axis), -0.5});
  }
  for (int i = 0; i < 2'000; ++i) {
    const Vector<6> z0 = random.vector<6>();
    auto problem = posed(box);
    REQUIRE(problem.solve(z0, kTolerance) == LeastDistance<6, kCapacity>::Status::optimal);
    REQUIRE((problem.z() - z0.cwiseMax(-half).cwiseMin(half)).norm() <= 1e-15 * 4.0);
  }
}

TEMPLATE_TEST_CASE_SIG("the answer is that of trying every set of active rows", "[least_distance]",
                       ((int N), N), 2, 3, 6) {
  RandomValues random(5);
  for (int i = 0; i < 1'500; ++i) {
    Rows<N> rows;
    const int count = random.integer(1, 7);
    for (int k = 0; k < count; ++k)
      rows.push_back({random.vector<N>(), random.normal()});  // some are infeasible
    require_same_as_enumeration<N>(rows, random.vector<N>());
  }
}

TEMPLATE_TEST_CASE_SIG("rows that repeat, oppose and lie in one plane are met as such", "[least_distance]",
                       ((int N), N), 2, 3, 6) {
  // Integers: many rows are equal, sums of others, or opposite.
  RandomValues random(6);
  for (int i = 0; i < 2'000; ++i) {
    Rows<N> rows;
    const int count = random.integer(2, 7);
    while (rows.size() < static_cast<std::size_t>(count)) {
      const Vector<N> b =
          Vector<N>::NullaryExpr([&] { return random.chance(0.5) ? 0 : random.integer(-1, 1); });
      if (b.norm() > 0.0) rows.push_back({b, static_cast<double>(random.integer(-2, 2))});
    }
    const Vector<N> z0 = Vector<N>::NullaryExpr([&] { return random.integer(-3, 3); });
    require_same_as_enumeration<N>(rows, z0);
  }
}

TEST_CASE("forty copies of a row are one row", "[least_distance]") {
  RandomValues random(7);
  for (int i = 0; i < 500; ++i) {
    const Vector<6> b = random.unit<6>();
    const Vector<6> other = random.unit<6>();
    const Vector<6> z0 = random.vector<6>();
    const Row<6> deep{b, b.dot(z0) + 0.5};
    const Row<6> second{other, other.dot(z0) + 0.3};
    Rows<6> many(40, deep);
    many.push_back(second);
    auto one = posed<6>({deep, second});
    auto all = posed(many);
    REQUIRE(one.solve(z0, kTolerance) == LeastDistance<6, kCapacity>::Status::optimal);
    REQUIRE(all.solve(z0, kTolerance) == LeastDistance<6, kCapacity>::Status::optimal);
    REQUIRE((one.z() - all.z()).norm() <= 1e-14);
    require_optimal<6>(many, z0, 1e-13);
  }
}

TEST_CASE("forty rows that span a plane only: a fan about one line", "[least_distance]") {
  // The case of a tool that rotates about an edge on the obstacle: any two rows determine the solution.
  RandomValues random(8);
  for (int i = 0; i < 500; ++i) {
    const Vector<6> on_line = random.vector<6>();
    const Vector<6> x = random.unit<6>();
    const Vector<6> y = random.unit<6>();
    Rows<6> fan;
    for (int k = 0; k < 40; ++k) {
      const double angle = random.uniform(-1.0, 1.0);
      const Vector<6> b = std::cos(angle) * x + std::sin(angle) * y;
      fan.push_back({b, b.dot(on_line)});
    }
    require_optimal<6>(fan, random.vector<6>(), 1e-11);
  }
}

TEST_CASE("a face on forty vertices: more active rows than unknowns", "[least_distance]") {
  RandomValues random(9);
  for (int i = 0; i < 500; ++i) {
    Rows<6> face;  // J = [n; a x n] for vertices a in a plane, all at the same depth
    const Vector3d n = random.unit<3>();
    for (int k = 0; k < 40; ++k) {
      const Vector3d a = n.cross(random.vector<3>()) - 0.5 * n;
      Vector<6> J;
      J << n, a.cross(n);
      face.push_back({J, 0.1});
    }
    require_optimal<6>(face, Vector<6>::Zero(), 1e-12);
    require_optimal<6>(face, random.vector<6>(0.1), 1e-11);
  }
}

TEST_CASE("nearly parallel rows", "[least_distance]") {
  RandomValues random(10);
  for (int decade = -14; decade <= -1; ++decade) {
    for (int i = 0; i < 100; ++i) {
      const double spread = std::pow(10.0, decade);
      const Vector<6> b = random.unit<6>();
      const Vector<6> inside = random.vector<6>();
      Rows<6> rows;
      for (int k = 0; k < 20; ++k) {
        const Vector<6> near_b = (b + spread * random.vector<6>()).normalized();
        rows.push_back({near_b, near_b.dot(inside)});
      }
      INFO("spread " << spread);
      using Status = LeastDistance<6, kCapacity>::Status;
      const Vector<6> z0 = inside - b;
      auto problem = posed(rows);
      REQUIRE(problem.solve(z0, 1e-13) == Status::optimal);
      const Violation worst = violation(problem, rows, z0);
      REQUIRE(worst.primal <= 1e-13);
      // At most as far as the common point, and at least as far as the most violated row.
      REQUIRE((problem.z() - z0).norm() <= 1.0 + 1e-12);
      double deepest = 0.0;
      for (const Row<6>& row : rows) deepest = std::max(deepest, row.c - row.b.dot(z0));
      REQUIRE((problem.z() - z0).norm() >= deepest - 1e-12);
    }
  }
}

TEMPLATE_TEST_CASE_SIG("rows that contradict each other are found out", "[least_distance]", ((int N), N), 3,
                       6, 7) {
  RandomValues random(11);
  using Status = typename LeastDistance<N, kCapacity>::Status;
  for (int i = 0; i < 2'000; ++i) {
    // Rows whose positive combination is zero while their bounds' is positive (Farkas), among others.
    const int in_conflict = random.integer(2, N + 1);
    Rows<N> rows;
    Vector<N> sum = Vector<N>::Zero();
    double bounds = 0.0;
    for (int k = 0; k + 1 < in_conflict; ++k) {
      const Vector<N> b = random.unit<N>();
      const double weight = random.uniform(0.2, 1.0);
      const double c = random.normal();
      rows.push_back({b, c});
      sum += weight * b;
      bounds += weight * c;
    }
    rows.push_back({-sum, -bounds + random.log_uniform(1e-3, 1.0)});
    for (int k = random.integer(0, 10); k > 0; --k)
      rows.push_back({random.unit<N>(), -random.uniform(0.0, 1.0)});
    auto problem = posed(rows);
    REQUIRE(problem.solve(random.vector<N>(), kTolerance) == Status::infeasible);
  }
}

TEST_CASE("two walls closer than the body: infeasible; farther apart: the middle", "[least_distance]") {
  for (const double room : {-1.0, -1e-3, -1e-9, -1e-13}) {
    auto problem = posed<3>({{Vector3d::UnitX(), 0.0}, {-Vector3d::UnitX(), -room}});
    INFO("room " << room);
    CHECK(problem.solve({-5.0, 1.0, 2.0}, kTolerance) == LeastDistance<3, kCapacity>::Status::infeasible);
  }
  for (const double room : {0.0, 1e-13, 1e-3, 1.0}) {
    auto problem = posed<3>({{Vector3d::UnitX(), 0.0}, {-Vector3d::UnitX(), -room}});
    INFO("room " << room);
    CHECK(problem.solve({-5.0, 1.0, 2.0}, kTolerance) == LeastDistance<3, kCapacity>::Status::optimal);
    CHECK(problem.z() == Vector3d(0.0, 1.0, 2.0));
  }
}

TEST_CASE("the length of a row does not change the solution; the multiplier refers to the given row",
          "[least_distance]") {
  RandomValues random(12);
  for (int i = 0; i < 1'000; ++i) {
    const Vector<6> inside = random.vector<6>();
    const Rows<6> rows = admissible_rows<6>(random, 12, inside);
    Rows<6> longer = rows;
    std::vector<double> factor;
    for (Row<6>& row : longer) {
      factor.push_back(std::ldexp(1.0, random.integer(-30, 30)));  // a power of two, which is exact
      row.b *= factor.back();
      row.c *= factor.back();
    }
    const Vector<6> z0 = random.vector<6>(10.0);
    auto a = posed(rows);
    auto b = posed(longer);
    REQUIRE(a.solve(z0, kTolerance) == b.solve(z0, kTolerance));
    REQUIRE(a.z() == b.z());
    for (std::size_t k = 0; k < rows.size(); ++k) REQUIRE(a.multiplier(k) == b.multiplier(k) * factor[k]);
  }
}

TEST_CASE("one solver object solves several problems in turn", "[least_distance]") {
  RandomValues random(13);
  LeastDistance<6, kCapacity> reused;
  for (int i = 0; i < 500; ++i) {
    const Rows<6> rows = admissible_rows<6>(random, random.integer(0, 40), random.vector<6>());
    const Vector<6> z0 = random.vector<6>(10.0);
    auto fresh = posed(rows);
    reused.clear();
    for (const Row<6>& row : rows) reused.add(row.b, row.c);
    REQUIRE(reused.count() == rows.size());
    REQUIRE(reused.solve(z0, kTolerance) == fresh.solve(z0, kTolerance));
    REQUIRE(reused.z() == fresh.z());
  }
}

}  // namespace wrenchd::test_least_distance
