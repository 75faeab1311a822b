// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/pairs/triangle_intersection.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_triangle_intersection {

namespace {

using namespace test;

TriangleMesh mesh_of(const Triangle& t) {
  return {{t[0], t[1], t[2]}, {{0, 1, 2}}};
}

TEST_CASE("two triangles intersect if and only if exact arithmetic finds it", "[triangle_intersection]") {
  RandomValues random(11);
  int intersecting = 0;
  for (int n = 0; n < 20000; ++n) {
    const double far = random.log_uniform(1e-2, 1e2), size = random.log_uniform(1e-2, 10.0);
    const Vector3d origin = random.vector<3>(far);
    Triangle p, q;
    for (Vector3d& v : p) v = origin + random.vector<3>();
    for (Vector3d& v : q) v = origin + random.vector<3>(size) + random.vector<3>(0.3);
    if (random.chance(0.2))  // nearly coplanar
      for (Vector3d& v : q)
        v -= (1.0 - 1e-3) * (p[1] - p[0]).cross(p[2] - p[0]).normalized() *
             (p[1] - p[0]).cross(p[2] - p[0]).normalized().dot(v - p[0]);
    const bool exact = ExactIntersection(mesh_of(p), mesh_of(q)).intersect(Pose{});
    intersecting += exact ? 1 : 0;
    REQUIRE(triangles_intersect(p, q) == exact);
    REQUIRE(triangles_intersect(q, p) == exact);
  }
  CHECK(intersecting > 2000);
  CHECK(intersecting < 18000);
}

TEST_CASE("coplanar triangles intersect if they overlap", "[triangle_intersection]") {
  const Triangle p = {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)};
  const auto shifted = [&](double x, double y) {
    Triangle q = p;
    for (Vector3d& v : q) v += Vector3d(x, y, 0);
    return q;
  };
  CHECK(triangles_intersect(p, shifted(0.5, 0.25)));
  CHECK(triangles_intersect(p, shifted(0.0, 0.0)));
  CHECK_FALSE(triangles_intersect(p, shifted(0.8, 0.8)));
  CHECK_FALSE(triangles_intersect(p, shifted(-1.1, 0.0)));
}

}  // namespace
}  // namespace wrenchd::test_triangle_intersection
