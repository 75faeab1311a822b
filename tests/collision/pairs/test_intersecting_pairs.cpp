// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/intersecting_pairs.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_intersecting_pairs {

namespace {

using namespace test;

std::set<std::pair<std::uint32_t, std::uint32_t>> make_state_set(const IntersectingPairs& pairs) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> out;
  for (const TrianglePair& pair : pairs.pairs()) out.insert({pair.a, pair.b});
  REQUIRE(out.size() == pairs.pairs().size());  // no pair occurs twice
  return out;
}

TEST_CASE("the intersecting pairs are those of exact arithmetic, on every processor",
          "[intersecting_pairs]") {
  const std::vector<std::pair<GeneratedMesh, GeneratedMesh>> cases = {
      {{"bumpy", 2000}, {"boulder", 3000}}, {{"cube", 12}, {"plate", 500}},
      {{"bolt", 2000}, {"nut", 2000}},      {{"gear", 3000}, {"gear", 1000}},
      {{"peg", 1000}, {"hole", 2000}},      {{"sphere", 80}, {"boulder", 20000}},
  };
  RandomValues random(31);
  IntersectingPairs fastest, portable(simd::traverse_portable);
  std::size_t all = 0, exact_tests = 0;
  for (const auto& [tool, obstacle] : cases) {
    const MeshBvh a(make_mesh(tool)), b(make_mesh(obstacle));
    const ExactIntersection exact(a.surface.mesh(), b.surface.mesh());
    const double reach_m = a.surface.radius_m() + b.surface.radius_m();
    for (int n = 0; n < 20; ++n) {
      const Pose X_BA = {random.rotation(), random.uniform(0.2, 0.95) * reach_m * random.unit<3>()};
      REQUIRE(fastest.find(a, b, X_BA));
      REQUIRE(portable.find(a, b, X_BA));
      CHECK(make_state_set(fastest) == make_state_set(portable));
      CHECK(fastest.pairs().size() == exact.intersecting_pairs(X_BA));
      all += fastest.pairs().size();
      exact_tests += fastest.double_precision_tests();
    }
  }
  CHECK(all > 2000);
  CHECK(exact_tests * 5 < all);  // single precision decides most pairs
}

// One pair decides, and single precision cannot classify it.
TEST_CASE("nearly touching meshes yield the pairs of exact arithmetic", "[intersecting_pairs]") {
  const MeshBvh a(make_mesh({"bumpy", 2000})), b(make_mesh({"boulder", 3000}));
  const ExactIntersection exact(a.surface.mesh(), b.surface.mesh());
  RandomValues random(32);
  IntersectingPairs pairs, portable(simd::traverse_portable);
  for (int n = 0; n < 20; ++n) {
    const Quaterniond R = random.rotation();
    const Vector3d out = random.unit<3>();
    double overlapping_m = 0.3 * b.surface.radius_m(), free_m = a.surface.radius_m() + b.surface.radius_m();
    while (free_m - overlapping_m > 1e-12) {
      const double middle_m = 0.5 * (free_m + overlapping_m);
      (exact.intersect({R, middle_m * out}) ? overlapping_m : free_m) = middle_m;
    }
    for (const double m :
         {free_m + 1e-7, free_m, overlapping_m, overlapping_m - 1e-9, overlapping_m - 1e-7}) {
      const Pose X_BA = {R, m * out};
      REQUIRE(pairs.find(a, b, X_BA));
      REQUIRE(portable.find(a, b, X_BA));
      CHECK(pairs.pairs().size() == exact.intersecting_pairs(X_BA));
      CHECK(make_state_set(pairs) == make_state_set(portable));
    }
  }
}

TEST_CASE("coplanar touching faces intersect in every touching pair of triangles", "[intersecting_pairs]") {
  const MeshBvh cube(make_mesh({"cube", 12})), large(make_mesh({"cube", 1200}));
  const ExactIntersection exact(cube.surface.mesh(), large.surface.mesh());
  const double edge_m = 2.0 * cube.surface.mesh().vertices_m[0].cwiseAbs().maxCoeff();
  IntersectingPairs pairs;
  for (const Vector3d& shift_m :
       {Vector3d(0, 0, edge_m), Vector3d(0.25 * edge_m, 0, edge_m), Vector3d(0, 0, 0)}) {
    const Pose X_BA = {Quaterniond::Identity(), shift_m};
    REQUIRE(pairs.find(cube, large, X_BA));
    CHECK(pairs.pairs().size() == exact.intersecting_pairs(X_BA));
    CHECK(pairs.pairs().size() > 100);
  }
}

TEST_CASE("a search with more pairs than room reports that it is incomplete", "[intersecting_pairs]") {
  const MeshBvh bumpy(make_mesh({"bumpy", 60000}));
  for (const simd::TraversalKernel kernel :
       {simd::TraversalKernel{nullptr}, simd::TraversalKernel{simd::traverse_portable}}) {
    IntersectingPairs pairs(kernel);
    CHECK_FALSE(pairs.find(bumpy, bumpy, Pose{}));  // every triangle intersects itself and its neighbours
    CHECK(pairs.pairs().size() <= BvhTraversal::kCapacity);
    CHECK(pairs.pairs().size() > BvhTraversal::kCapacity / 2);
  }
}

TEST_CASE("a mesh without triangles intersects nothing", "[intersecting_pairs]") {
  const MeshBvh cube(make_mesh({"cube", 12})), nothing(TriangleMesh{});
  IntersectingPairs pairs;
  CHECK(pairs.find(cube, nothing, Pose{}));
  CHECK(pairs.pairs().empty());
}

}  // namespace
}  // namespace wrenchd::test_intersecting_pairs
