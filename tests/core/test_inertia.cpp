// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>

#include "core/inertia.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_inertia {

using test::RandomValues;

namespace {

/// A closed box with its centre at the origin of the mesh.
TriangleMesh box(double x_m, double y_m, double z_m) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices_m.emplace_back((i & 1 ? 0.5 : -0.5) * x_m, (i & 2 ? 0.5 : -0.5) * y_m,
                                 (i & 4 ? 0.5 : -0.5) * z_m);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TriangleMesh tetrahedron(const std::array<Vector3d, 4>& p) {
  TriangleMesh mesh{{p.begin(), p.end()}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
  if ((p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]) < 0.0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  return mesh;
}

TriangleMesh random_tetrahedron(RandomValues& random) {
  for (;;) {
    const std::array<Vector3d, 4> p = {random.vector<3>(), random.vector<3>(), random.vector<3>(),
                                       random.vector<3>()};
    if (std::abs((p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0])) > 0.3) return tetrahedron(p);
  }
}

TriangleMesh moved(TriangleMesh mesh, const Pose& X) {
  for (Vector3d& p : mesh.vertices_m) p = X * p;
  return mesh;
}

TriangleMesh scaled(TriangleMesh mesh, double c) {
  for (Vector3d& p : mesh.vertices_m) p *= c;
  return mesh;
}

TriangleMesh inside_out(TriangleMesh mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  return mesh;
}

/// Returns another mesh of the same solid: every triangle divided into four.
TriangleMesh refined(const TriangleMesh& mesh) {
  TriangleMesh fine = mesh;
  fine.triangles.clear();
  const auto middle = [&fine](std::uint32_t a, std::uint32_t b) {
    fine.vertices_m.push_back(0.5 * (fine.vertices_m[a] + fine.vertices_m[b]));
    return static_cast<std::uint32_t>(fine.vertices_m.size() - 1);
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint32_t ab = middle(a, b);
    const std::uint32_t bc = middle(b, c);
    const std::uint32_t ca = middle(c, a);
    for (const auto& t : {std::array{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}})
      fine.triangles.push_back(t);
  }
  return fine;
}

void require_equal(const Matrix3d& a, const Matrix3d& b, double relative) {
  REQUIRE((a - b).cwiseAbs().maxCoeff() <= relative * b.cwiseAbs().maxCoeff());
}

}  // namespace

TEST_CASE("a cube: m a^2 / 6 about every axis", "[inertia]") {
  const SolidProperties cube = solid_properties(box(50.0, 50.0, 50.0), 1.0);  // the cube of example 4.1
  CHECK(cube.volume_m3 == Approx(125'000.0).epsilon(1e-14));
  CHECK(cube.p_MT_m.norm() <= 1e-13);
  CHECK(cube.inertia.mass_kg == 1.0);
  require_equal(cube.inertia.H_kg_m2, 2500.0 / 6.0 * Matrix3d::Identity(), 1e-14);
}

TEST_CASE("a box: m (b^2 + c^2) / 12 about the axis along a", "[inertia]") {
  RandomValues random(1);
  for (int i = 0; i < 200; ++i) {
    const double a = random.log_uniform(1e-3, 10.0);
    const double b = random.log_uniform(1e-3, 10.0);
    const double c = random.log_uniform(1e-3, 10.0);
    const double m = random.log_uniform(0.01, 100.0);
    const SolidProperties solid = solid_properties(box(a, b, c), m);
    const Vector3d closed_form = m / 12.0 * Vector3d(b * b + c * c, a * a + c * c, a * a + b * b);
    REQUIRE(solid.volume_m3 == Approx(a * b * c).epsilon(1e-13));
    require_equal(solid.inertia.H_kg_m2, closed_form.asDiagonal(), 1e-13);
  }
}

TEST_CASE("a regular tetrahedron: m s^2 / 20 about every axis", "[inertia]") {
  const SolidProperties solid =
      solid_properties(tetrahedron({Vector3d(1, 1, 1), {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}), 3.0);
  const double s2 = 8.0;  // side squared
  CHECK(solid.volume_m3 == Approx(std::pow(s2, 1.5) / (6.0 * std::sqrt(2.0))).epsilon(1e-14));
  CHECK(solid.p_MT_m.norm() <= 1e-15);
  require_equal(solid.inertia.H_kg_m2, 3.0 * s2 / 20.0 * Matrix3d::Identity(), 1e-14);
}

TEST_CASE("Tonon's example of a tetrahedron", "[inertia]") {
  // F. Tonon, Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of its vertex
  // coordinates, J. Math. Stat. 1 (2005): unit density, volume 1873.233236. The paper
  // prints nine digits for vertices of six digits.
  const TriangleMesh mesh = tetrahedron({Vector3d(8.33220, -11.86875, 0.93355),
                                         {0.75523, 5.00000, 16.37072},
                                         {52.61236, 5.00000, -5.38580},
                                         {2.00000, 5.00000, 3.00000}});
  const double density_volume = solid_properties(mesh, 1.0).volume_m3;
  const SolidProperties solid = solid_properties(mesh, density_volume);
  CHECK(solid.volume_m3 == Approx(1873.233236).epsilon(1e-7));
  CHECK((solid.p_MT_m - Vector3d(15.92492, 0.78281, 3.72962)).norm() <= 5e-5);
  const Matrix3d& H = solid.inertia.H_kg_m2;
  CHECK(H(0, 0) == Approx(43520.33257).epsilon(2e-7));
  CHECK(H(1, 1) == Approx(194711.28938).epsilon(2e-7));
  CHECK(H(2, 2) == Approx(191168.76173).epsilon(2e-7));
  CHECK(H(1, 2) == Approx(-4417.66150).epsilon(2e-7).margin(1e-2));
  CHECK(H(0, 2) == Approx(46343.16662).epsilon(2e-7).margin(1e-2));
  CHECK(H(0, 1) == Approx(-11996.20119).epsilon(2e-7).margin(1e-2));
}

TEST_CASE("the second moments of a tetrahedron follow from its corners", "[inertia]") {
  // int (x - c)(x - c)' dV / V = sum (p_i - c)(p_i - c)' / 20
  RandomValues random(2);
  for (int i = 0; i < 500; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const double m = random.log_uniform(0.1, 10.0);
    const SolidProperties solid = solid_properties(mesh, m);
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& p : mesh.vertices_m) centre += 0.25 * p;
    Matrix3d C = Matrix3d::Zero();
    for (const Vector3d& p : mesh.vertices_m) C += (p - centre) * (p - centre).transpose() / 20.0;
    REQUIRE((solid.p_MT_m - centre).norm() <= 1e-14 * (1.0 + centre.norm()));
    require_equal(solid.inertia.H_kg_m2, m * (C.trace() * Matrix3d::Identity() - C), 1e-13);
  }
}

TEST_CASE("moving a solid moves its centre of mass and rotates its inertia", "[inertia]") {
  RandomValues random(3);
  for (int i = 0; i < 500; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const Pose X = random.pose();
    const Matrix3d R = X.rotation.toRotationMatrix();
    const SolidProperties before = solid_properties(mesh, 2.0);
    const SolidProperties after = solid_properties(moved(mesh, X), 2.0);
    REQUIRE(after.volume_m3 == Approx(before.volume_m3).epsilon(1e-12));
    REQUIRE((after.p_MT_m - X * before.p_MT_m).norm() <= 1e-13);
    require_equal(after.inertia.H_kg_m2, R * before.inertia.H_kg_m2 * R.transpose(), 1e-12);
  }
}

TEST_CASE("lengths times c: volume times c^3, inertia times c^2 at equal mass", "[inertia]") {
  RandomValues random(4);
  for (int i = 0; i < 500; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const double c = random.log_uniform(1e-6, 1e6);
    const SolidProperties before = solid_properties(mesh, 2.0);
    const SolidProperties after = solid_properties(scaled(mesh, c), 2.0);
    REQUIRE(after.volume_m3 == Approx(c * c * c * before.volume_m3).epsilon(1e-12));
    REQUIRE((after.p_MT_m - c * before.p_MT_m).norm() <= 1e-14 * c * (1.0 + before.p_MT_m.norm()));
    require_equal(after.inertia.H_kg_m2, c * c * before.inertia.H_kg_m2, 1e-12);
  }
}

TEST_CASE("mass times c: inertia times c, same centre of mass", "[inertia]") {
  RandomValues random(5);
  for (int i = 0; i < 200; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const double c = random.log_uniform(1e-3, 1e3);
    const SolidProperties one = solid_properties(mesh, 1.0);
    const SolidProperties other = solid_properties(mesh, c);
    REQUIRE(other.volume_m3 == one.volume_m3);
    REQUIRE(other.p_MT_m == one.p_MT_m);
    REQUIRE(other.inertia.mass_kg == c);
    require_equal(other.inertia.H_kg_m2, c * one.inertia.H_kg_m2, 1e-15);
  }
}

TEST_CASE("mass properties do not depend on the triangulation of the faces", "[inertia]") {
  RandomValues random(6);
  for (int i = 0; i < 50; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const SolidProperties coarse = solid_properties(mesh, 1.0);
    const SolidProperties fine = solid_properties(refined(refined(mesh)), 1.0);
    REQUIRE(fine.volume_m3 == Approx(coarse.volume_m3).epsilon(1e-12));
    REQUIRE((fine.p_MT_m - coarse.p_MT_m).norm() <= 1e-13);
    require_equal(fine.inertia.H_kg_m2, coarse.inertia.H_kg_m2, 1e-12);
  }
}

TEST_CASE("two solids side by side are one: the parallel axis theorem", "[inertia]") {
  RandomValues random(7);
  for (int i = 0; i < 200; ++i) {
    const TriangleMesh a = random_tetrahedron(random);
    const TriangleMesh b = moved(random_tetrahedron(random), {Quaterniond::Identity(), {20.0, 0.0, 0.0}});
    TriangleMesh both = a;
    for (const Vector3d& p : b.vertices_m) both.vertices_m.push_back(p);
    for (const auto& [i0, i1, i2] : b.triangles) both.triangles.push_back({i0 + 4, i1 + 4, i2 + 4});
    const double volume_a = solid_properties(a, 1.0).volume_m3;
    const double volume_b = solid_properties(b, 1.0).volume_m3;
    const SolidProperties A = solid_properties(a, volume_a);
    const SolidProperties B = solid_properties(b, volume_b);
    const SolidProperties AB = solid_properties(both, volume_a + volume_b);
    const Vector3d centre = (volume_a * A.p_MT_m + volume_b * B.p_MT_m) / (volume_a + volume_b);
    const auto about_centre = [&centre](const SolidProperties& s) -> Matrix3d {
      const Matrix3d d = hat(s.p_MT_m - centre);
      return s.inertia.H_kg_m2 - s.inertia.mass_kg * d * d;
    };
    REQUIRE((AB.p_MT_m - centre).norm() <= 1e-12);
    require_equal(AB.inertia.H_kg_m2, about_centre(A) + about_centre(B), 1e-11);
  }
}

TEST_CASE("an inertia is symmetric, positive, and satisfies the triangle inequality", "[inertia]") {
  RandomValues random(8);
  for (int i = 0; i < 500; ++i) {
    const Matrix3d H = solid_properties(random_tetrahedron(random), 1.0).inertia.H_kg_m2;
    REQUIRE((H - H.transpose()).cwiseAbs().maxCoeff() <= 1e-16 * H.cwiseAbs().maxCoeff() * 4.0);
    const Vector3d moments = Eigen::SelfAdjointEigenSolver<Matrix3d>(H).eigenvalues();
    REQUIRE(moments[0] > 0.0);
    REQUIRE(moments[0] + moments[1] > moments[2]);
  }
}

TEST_CASE("mass properties are accurate for a mesh a thousand kilometres from its origin", "[inertia]") {
  // The coordinates are rounded to 1e-10 m; the tolerance is that rounding.
  RandomValues random(9);
  for (int i = 0; i < 200; ++i) {
    const TriangleMesh near = random_tetrahedron(random);
    const Vector3d away = 1e6 * random.unit<3>();
    const SolidProperties here = solid_properties(near, 1.0);
    const SolidProperties there = solid_properties(moved(near, {Quaterniond::Identity(), away}), 1.0);
    REQUIRE(there.volume_m3 == Approx(here.volume_m3).epsilon(1e-8));
    REQUIRE((there.p_MT_m - (here.p_MT_m + away)).norm() <= 1e-9);
    require_equal(there.inertia.H_kg_m2, here.inertia.H_kg_m2, 1e-8);
  }
  // With exactly representable coordinates the result is exact.
  const TriangleMesh cube = box(1.0, 2.0, 4.0);
  const Vector3d away(1048576.0, -1048576.0, 524288.0);
  const SolidProperties there = solid_properties(moved(cube, {Quaterniond::Identity(), away}), 12.0);
  CHECK(there.volume_m3 == Approx(8.0).epsilon(1e-15));
  CHECK(there.p_MT_m == away);
  require_equal(there.inertia.H_kg_m2, Vector3d(20.0, 17.0, 5.0).asDiagonal(), 1e-15);
}

TEST_CASE("an inside-out mesh has a negative volume", "[inertia]") {
  RandomValues random(10);
  for (int i = 0; i < 100; ++i) {
    const TriangleMesh mesh = random_tetrahedron(random);
    const SolidProperties solid = solid_properties(inside_out(mesh), 5.0);
    REQUIRE(solid.volume_m3 == Approx(-solid_properties(mesh, 5.0).volume_m3).epsilon(1e-13));
    REQUIRE(solid.inertia.H_kg_m2 == Matrix3d::Identity());
  }
}

TEST_CASE("a mesh without a volume is reported", "[inertia]") {
  CHECK(solid_properties(TriangleMesh{}, 1.0).volume_m3 == 0.0);
  CHECK(solid_properties(box(1.0, 1.0, 0.0), 1.0).volume_m3 == 0.0);
  TriangleMesh not_a_number = box(1.0, 1.0, 1.0);
  not_a_number.vertices_m[3].y() = std::nan("");
  CHECK_FALSE(solid_properties(not_a_number, 1.0).volume_m3 > 0.0);
}

}  // namespace wrenchd::test_inertia
