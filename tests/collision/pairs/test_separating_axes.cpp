// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/separating_axes.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_separating_axes {

namespace {

using namespace test;

std::vector<SeparatingAxes> kernels() {
  std::vector<SeparatingAxes> all = {SeparatingAxes(simd::separated_portable)};
  if (simd::has_avx2()) all.emplace_back(simd::separated_avx2);
  return all;
}

Triangle triangle(RandomValues& random, const Vector3d& where, double size_m) {
  const auto corner = [&]() -> Vector3d {
    return where + size_m * random.uniform(0.1, 1.0) * random.unit<3>();
  };
  return {corner(), corner(), corner()};
}

Triangle moved(const Triangle& t, const Vector3d& by_m) {
  return {t[0] + by_m, t[1] + by_m, t[2] + by_m};
}

Triangle between(const Triangle& a, const Triangle& b, double t) {
  return {(1 - t) * a[0] + t * b[0], (1 - t) * a[1] + t * b[1], (1 - t) * a[2] + t * b[2]};
}

TEST_CASE("separating axes never separate a pair that meets on the path, at any size and position",
          "[separating_axes]") {
  RandomValues random(17);
  int met = 0, apart = 0, parted = 0;
  const int runs = case_count(20000);
  for (int n = 0; n < runs; ++n) {
    const double size_m = random.log_uniform(1e-6, 1.0);
    const Vector3d where = random.log_uniform(1e-3, 1.0) * random.unit<3>();
    const Triangle b = triangle(random, where, size_m);
    const Triangle start = triangle(random, where + 0.5 * size_m * random.unit<3>(), size_m);
    const Vector3d path_m = size_m * random.log_uniform(1e-4, 3.0) * random.unit<3>();
    Triangle end = moved(start, path_m);
    for (Vector3d& p : end) p += 0.1 * size_m * random.unit<3>();  // includes a rotation
    bool meets = false;
    for (int k = 0; k <= 20 && !meets; ++k) meets = triangles_intersect(between(start, end, k / 20.0), b);
    met += meets;
    parted += !meets;
    bool all = true;
    for (const SeparatingAxes& axes : kernels()) {
      const bool says_apart = axes.separated(start, end, b, 0.0);
      if (meets) CHECK_FALSE(says_apart);
      all = all && says_apart;
    }
    apart += all;
  }
  CHECK(met > runs / 20);
  CHECK(apart > parted / 2);
}

TEST_CASE("separating axes respect the margin, down to 1 nm between small triangles", "[separating_axes]") {
  RandomValues random(18);
  const double size_m = 1e-4;
  for (int n = 0; n < 300; ++n) {
    // One corner lies above the middle of the other triangle's side. Only a plane that contains that side and
    // the normal, or one parallel to two edges, separates them.
    const Quaterniond rotation = random.rotation();
    const Vector3d place = 0.1 * random.unit<3>();
    const auto put = [&](double x, double y, double z) -> Vector3d {
      return place + rotation * (size_m * Vector3d(x, y, z));
    };
    const Triangle b = {put(-1, 0, 0), put(1, 0, 0), put(0, -1, 0)};
    const double gap_m = random.log_uniform(1e-8, 1e-5);
    const double y = gap_m / size_m;
    const Triangle a = {put(0, y, 0), put(0.3, y + 1, 1), put(-0.3, y + 1, -1)};
    for (const SeparatingAxes& axes : kernels()) {
      CHECK(axes.separated(a, a, b, 0.5 * gap_m));
      CHECK_FALSE(axes.separated(a, a, b, 1.5 * gap_m));
      CHECK_FALSE(axes.separated(a, moved(a, place - put(0, 2 * y, 0)), b, 0.5 * gap_m));
    }
  }
}

TEST_CASE("triangles without area are never separated wrongly", "[separating_axes]") {
  const Vector3d p(0.1, 0.2, 0.3), q = p + Vector3d(1e-3, 0, 0);
  const Triangle point = {p, p, p}, line = {p, q, p};
  const Triangle b = {p - Vector3d(1e-3, 1e-3, 0), p + Vector3d(2e-3, -1e-3, 0), p + Vector3d(0, 2e-3, 0)};
  for (const SeparatingAxes& axes : kernels()) {
    CHECK_FALSE(axes.separated(point, point, point, 0.0));
    CHECK_FALSE(axes.separated(point, point, b, 0.0));
    CHECK_FALSE(axes.separated(line, line, b, 0.0));
    CHECK_FALSE(axes.separated(b, b, line, 0.0));
  }
}

}  // namespace
}  // namespace wrenchd::test_separating_axes
