// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/pair_culler.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_pair_culler {

namespace {

using namespace test;

struct Bodies {
  MeshSurface tool = MeshSurface(make_mesh({"bumpy", 500}), BodyKind::solid);
  MeshSurface obstacle = MeshSurface(make_mesh({"boulder", 800}), BodyKind::solid);

  double extent_m() const { return tool.radius_m() + obstacle.radius_m(); }
  std::uint32_t any(RandomValues& random, const MeshSurface& of) const {
    return static_cast<std::uint32_t>(random.integer(0, static_cast<int>(of.triangles().size()) - 1));
  }
};

/// Returns a tool pose at which a triangle of the tool is near a triangle of the obstacle.
Pose near(RandomValues& random, const Bodies& bodies, std::uint32_t a, std::uint32_t b, double away_m) {
  const Quaterniond rotation = random.rotation();
  return {rotation, bodies.obstacle.corner_m(b, 0) - rotation * bodies.tool.corner_m(a, 1) +
                        random.uniform(0.0, away_m) * random.unit<3>()};
}

/// Points on the straight path of each corner.
bool meet(const Bodies& bodies, std::uint32_t a, std::uint32_t b, const Frame& from, const Frame& to,
          double t) {
  Triangle moved, still;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Vector3d& p = bodies.tool.corner_m(a, k);
    moved[i] = (1.0 - t) * (from * p) + t * (to * p);
    still[i] = bodies.obstacle.corner_m(b, k);
  }
  return triangles_intersect(moved, still);
}

TEST_CASE("the culler keeps every pair that meets on the path, on every processor", "[pair_culler]") {
  const Bodies bodies;
  RandomValues random(51);
  PairCuller fastest(8, 1, bodies.tool.radius_m()),
      portable(8, 1, bodies.tool.radius_m(), simd::cull_portable);
  int met = 0, left_out = 0;
  const int runs = case_count(20000);
  for (int n = 0; n < runs; ++n) {
    const std::uint32_t a = bodies.any(random, bodies.tool), b = bodies.any(random, bodies.obstacle);
    const Pose X_start = near(random, bodies, a, b, 0.01);
    // The rotation is so small that chord and arc agree.
    const Pose X_end = {(X_start.rotation * random.rotation(1e-4)).normalized(),
                        X_start.translation_m + random.log_uniform(1e-6, 1e-2) * random.unit<3>()};
    const Frame from(X_start), to(X_end);
    const auto remaining = [&](PairCuller& culler) {
      culler.clear();
      culler.add(bodies.tool, a, bodies.obstacle, b, 0);
      std::uint32_t pair = 7;
      const std::size_t count = culler.cull(0, from, to, bodies.extent_m(), 1e-8, &pair).remaining;
      if (count == 1) CHECK(pair == 0);
      return count;
    };
    const std::size_t by_fastest = remaining(fastest), by_portable = remaining(portable);
    bool meets = false;
    for (int k = 0; k <= 20 && !meets; ++k) meets = meet(bodies, a, b, from, to, k / 20.0);
    met += meets;
    left_out += by_fastest == 0;
    if (meets) {
      CHECK(by_fastest == 1);
      CHECK(by_portable == 1);
    }
  }
  CHECK(met > runs / 100);
  CHECK(left_out > runs / 4);
}

TEST_CASE("the culler removes pairs that are apart by more than rounding and the margin", "[pair_culler]") {
  const MeshSurface tool(make_mesh({"cube", 12}), BodyKind::solid);
  const MeshSurface obstacle(make_mesh({"cube", 12}), BodyKind::solid);
  const double size_m = 2.0 * obstacle.vertices_m()[0].cwiseAbs().maxCoeff();
  constexpr double kMargin_m = 1e-4;
  const auto remaining = [&](const Vector3d& from_m, const Vector3d& to_m) {
    PairCuller culler(144, 1, tool.radius_m());
    for (std::uint32_t a = 0; a < 12; ++a)
      for (std::uint32_t b = 0; b < 12; ++b) culler.add(tool, a, obstacle, b, 0);
    std::array<std::uint32_t, 144> pairs;
    return culler
        .cull(0, Frame(Pose{Quaterniond::Identity(), from_m}), Frame(Pose{Quaterniond::Identity(), to_m}),
              2.0 * size_m, kMargin_m, pairs.data())
        .remaining;
  };
  for (const Vector3d& path : {Vector3d(1, 0, 0), Vector3d(0, -1, 0), Vector3d(0, 0, 1)}) {
    const Vector3d apart = (size_m + 1.1 * kMargin_m) * path, near = (size_m + 0.9 * kMargin_m) * path;
    CHECK(remaining(apart, apart) == 0);
    CHECK(remaining(near, near) > 0);
    CHECK(remaining(apart, near) > 0);
    CHECK(remaining(near, apart) > 0);
    CHECK(remaining(apart, -apart) > 0);  // the path passes through the obstacle
  }
}

TEST_CASE("the remaining pairs are numbered over all groups, in order", "[pair_culler]") {
  const Bodies bodies;
  RandomValues random(52);
  for (const simd::CullKernel kernel : {simd::CullKernel{nullptr}, simd::CullKernel{simd::cull_portable}}) {
    PairCuller culler(2000, 3, bodies.tool.radius_m(), kernel), alone(1, 1, bodies.tool.radius_m(), kernel);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    const Pose X = {random.rotation(), {0.05, 0.03, 0.0}};
    const Frame from(X), to(Pose{X.rotation, X.translation_m + Vector3d(0.0, 0.0, 1e-3)});
    for (const auto& [obstacle, count] : {std::pair{4U, 1003}, {1U, 5}, {9U, 600}})
      for (int n = 0; n < count; ++n) {
        pairs.emplace_back(bodies.any(random, bodies.tool), bodies.any(random, bodies.obstacle));
        culler.add(bodies.tool, pairs.back().first, bodies.obstacle, pairs.back().second, obstacle);
      }
    REQUIRE(culler.groups().size() == 3);
    CHECK(culler.groups()[1].obstacle == 1);
    std::vector<std::uint32_t> remaining(2000), expected, all;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t count = culler.cull(k, from, to, bodies.extent_m(), 2e-3, remaining.data()).remaining;
      all.insert(all.end(), remaining.begin(), remaining.begin() + static_cast<std::ptrdiff_t>(count));
    }
    for (std::uint32_t i = 0; i < pairs.size(); ++i) {
      alone.clear();
      alone.add(bodies.tool, pairs[i].first, bodies.obstacle, pairs[i].second, 0);
      if (alone.cull(0, from, to, bodies.extent_m(), 2e-3, remaining.data()).remaining == 1)
        expected.push_back(i);
    }
    CHECK(all == expected);
    CHECK_FALSE(expected.empty());
    CHECK(expected.size() < pairs.size());
  }
}

// The tool moves randomly around a pose at which the two meet, in small and large steps. The pairs are those
// around that pose.
TEST_CASE("stored separations never hide a pair that meets, on any path", "[pair_culler]") {
  const Bodies bodies;
  for (const simd::CullKernel kernel : {simd::CullKernel{nullptr}, simd::CullKernel{simd::cull_portable}}) {
    RandomValues random(53);
    PairCuller culler(4000, 1, bodies.tool.radius_m(), kernel);
    std::vector<std::uint32_t> remaining(4000);
    std::size_t tested = 0, of = 0, met = 0;
    for (int place = 0; place < case_count(20); ++place) {
      const Pose X_near =
          near(random, bodies, bodies.any(random, bodies.tool), bodies.any(random, bodies.obstacle), 0.0);
      const Frame there(X_near);
      std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
      culler.clear();
      for (std::uint32_t a = 0; a < bodies.tool.triangles().size(); ++a)
        for (std::uint32_t b = 0; b < bodies.obstacle.triangles().size() && pairs.size() < 4000; ++b)
          if ((there * bodies.tool.corner_m(a, 0) - bodies.obstacle.corner_m(b, 0)).norm() < 0.012) {
            pairs.emplace_back(a, b);
            culler.add(bodies.tool, a, bodies.obstacle, b, 0);
          }
      Pose X = X_near;
      for (int n = 0; n < 60; ++n) {
        const double step = random.log_uniform(1e-7, random.chance(0.1) ? 1e-2 : 1e-4);
        Pose X_next = {(X.rotation * random.rotation(step)).normalized(),
                       X.translation_m + 0.04 * step * random.unit<3>()};
        if ((X_next.translation_m - X_near.translation_m).norm() > 2e-3) X_next = X_near;
        const Frame from(X), to(X_next);
        const PairCuller::CullResult culled =
            culler.cull(0, from, to, bodies.extent_m(), 1e-7, remaining.data());
        tested += culled.tested;
        of += pairs.size();
        const std::set<std::uint32_t> remain(
            remaining.begin(), remaining.begin() + static_cast<std::ptrdiff_t>(culled.remaining));
        for (std::uint32_t i = 0; i < pairs.size(); ++i) {
          if (!meet(bodies, pairs[i].first, pairs[i].second, from, to, 0.0) &&
              !meet(bodies, pairs[i].first, pairs[i].second, from, to, 1.0))
            continue;
          ++met;
          CHECK(remain.count(i) == 1);
        }
        X = X_next;
      }
    }
    CHECK(met > 1000);
    CHECK(tested < 3 * of / 4);  // stored separations save tests
  }
}

TEST_CASE("the culler tests all pairs again after a large displacement", "[pair_culler]") {
  const Bodies bodies;
  RandomValues random(54);
  PairCuller culler(800, 1, bodies.tool.radius_m());
  for (int n = 0; n < 800; ++n)
    culler.add(bodies.tool, bodies.any(random, bodies.tool), bodies.obstacle,
               bodies.any(random, bodies.obstacle), 0);
  std::vector<std::uint32_t> remaining(800);
  const auto asked_at = [&](const Pose& X) {
    return culler.cull(0, Frame(X), Frame(X), bodies.extent_m(), 1e-7, remaining.data()).tested;
  };
  const Pose here = {Quaterniond::Identity(), {0.2, 0, 0}};
  CHECK(asked_at(here) == 800);
  CHECK(asked_at(here) == 0);
  CHECK(asked_at({rotation_from({0.0, 0.0, 2.0}), here.translation_m}) == 800);
  CHECK(asked_at(here) == 800);
}

// A peg starts in its hole, as one group of a culler without stored separations.
TEST_CASE("the culler tests all pairs that were added", "[pair_culler]") {
  const MeshSurface tool(make_mesh({"cube", 12}), BodyKind::solid);
  const MeshSurface obstacle(make_mesh({"cube", 12}), BodyKind::solid);
  const Frame here(Pose{Quaterniond::Identity(), {1e-3, 0, 0}});
  std::uint32_t opposite = 0;
  while (tool.planes()[0].normal.dot(obstacle.planes()[opposite].normal) > -0.9) ++opposite;
  PairCuller culler(16, 1, tool.radius_m());
  std::vector<std::uint32_t> remaining(16);
  for (int list = 0; list < 2; ++list) {
    culler.clear();
    for (std::uint32_t n = 0; n < 16; ++n) culler.add(tool, 0, obstacle, opposite, 0);
    const auto cull = [&] { return culler.cull(0, here, here, 0.2, 1e-7, remaining.data()); };
    CHECK(cull().tested == 16);
    REQUIRE(cull().remaining == 0);
    CHECK(cull().tested == 0);
  }
}

}  // namespace
}  // namespace wrenchd::test_pair_culler
