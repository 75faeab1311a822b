// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "collision/scene.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_bvh_traversal {

namespace {

using namespace test;

using PairSet = std::set<std::pair<std::uint32_t, std::uint32_t>>;

Triangle triangle(const MeshSurface& surface, std::uint32_t t, const Pose& X) {
  return {X * surface.corner_m(t, 0), X * surface.corner_m(t, 1), X * surface.corner_m(t, 2)};
}

/// Counts the listed pairs that intersect at a pose.
PairSet intersecting(BvhTraversal& traversal, const MeshBvh& a, const MeshBvh& b, const Sweep& sweep,
                     const Pose& X_BA) {
  VisitBudget budget = {1000000000};
  REQUIRE(traversal.find(a.bvh, b.bvh, sweep, budget));
  PairSet out;
  for (const TrianglePair& pair : traversal)
    if (triangles_intersect(triangle(a.surface, pair.a, X_BA), triangle(b.surface, pair.b, Pose{})))
      out.insert({pair.a, pair.b});
  return out;
}

/// Returns a pose at which the two meshes touch or overlap.
Pose near_pose(RandomValues& random, const MeshBvh& a, const MeshBvh& b) {
  const double reach = a.surface.radius_m() + b.surface.radius_m();
  return {random.rotation(), random.uniform(0.3, 0.95) * reach * random.unit<3>()};
}

const std::vector<std::pair<GeneratedMesh, GeneratedMesh>>& mesh_pairs() {
  static const std::vector<std::pair<GeneratedMesh, GeneratedMesh>> pairs = {
      {{"bumpy", 2000}, {"boulder", 3000}}, {{"cube", 12}, {"plate", 500}},
      {{"bolt", 2000}, {"nut", 2000}},      {{"gear", 3000}, {"gear", 1000}},
      {{"peg", 1000}, {"hole", 2000}},      {{"sphere", 80}, {"boulder", 20000}},
  };
  return pairs;
}

TEST_CASE("a traversal finds every pair that exact arithmetic finds, on every processor", "[bvh_traversal]") {
  RandomValues random(21);
  BvhTraversal fastest, portable(simd::traverse_portable);
  std::size_t all = 0;
  for (const auto& [tool, obstacle] : mesh_pairs()) {
    const MeshBvh a(make_mesh(tool)), b(make_mesh(obstacle));
    const ExactIntersection exact(a.surface.mesh(), b.surface.mesh());
    for (int n = 0; n < 12; ++n) {
      const Pose X_BA = near_pose(random, a, b);
      const Sweep sweep = {X_BA, X_BA};
      const PairSet found = intersecting(fastest, a, b, sweep, X_BA);
      CHECK(found == intersecting(portable, a, b, sweep, X_BA));
      CHECK(found.size() == exact.intersecting_pairs(X_BA));
      all += found.size();
    }
  }
  CHECK(all > 1000);
}

// The pairs that a swept traversal must list are found by sampling: pairs that intersect at many poses on the
// path, and at many within reach of its end.
TEST_CASE("a swept traversal lists every pair that meets on the path or within reach of its end",
          "[bvh_traversal]") {
  RandomValues random(22);
  BvhTraversal still, swept, portable(simd::traverse_portable);
  std::size_t all = 0;
  for (const auto& [tool, obstacle] : mesh_pairs()) {
    const MeshBvh a(make_mesh(tool)), b(make_mesh(obstacle));
    const double r = a.surface.radius_m();
    for (int n = 0; n < 8; ++n) {
      Sweep sweep;
      sweep.X_BA_start = near_pose(random, a, b);
      const double path = r * random.log_uniform(1e-4, 0.3), rotation = random.log_uniform(1e-4, 0.05);
      sweep.X_BA_end = {(sweep.X_BA_start.rotation * random.rotation(rotation)).normalized(),
                        sweep.X_BA_start.translation_m + path * random.unit<3>()};
      sweep.reach_m = 0.3 * (path + rotation * r);
      VisitBudget budget = {1000000000};
      std::set<std::pair<std::uint32_t, std::uint32_t>> listed, listed_portable;
      const bool complete = swept.find(a.bvh, b.bvh, sweep, budget);
      if (!complete) continue;  // the path is too long for the list
      for (const TrianglePair& pair : swept) listed.insert({pair.a, pair.b});
      CHECK(portable.find(a.bvh, b.bvh, sweep, budget));
      for (const TrianglePair& pair : portable) listed_portable.insert({pair.a, pair.b});
      for (int k = 0; k < 12; ++k) {
        const double s = k / 11.0;
        Pose X = {sweep.X_BA_start.rotation.slerp(s, sweep.X_BA_end.rotation),
                  sweep.X_BA_start.translation_m +
                      s * (sweep.X_BA_end.translation_m - sweep.X_BA_start.translation_m)};
        if (k % 2 == 0) {
          const double shift = random.uniform(0.0, 1.0);
          X = {(sweep.X_BA_end.rotation * random.rotation((1.0 - shift) * sweep.reach_m / r)).normalized(),
               sweep.X_BA_end.translation_m + shift * sweep.reach_m * random.unit<3>()};
        }
        for (const auto& pair : intersecting(still, a, b, {X, X}, X)) {
          ++all;
          // No plane separates a pair that meets or passes, so it is always listed.
          REQUIRE(listed.count(pair) == 1);
          REQUIRE(listed_portable.count(pair) == 1);
        }
      }
    }
  }
  CHECK(all > 5000);
}

TEST_CASE("a traversal omits pairs without features that can meet first, if requested", "[bvh_traversal]") {
  const MeshBvh a(make_mesh({"cube", 5000})), b(make_mesh({"table", 5000}));
  const Pose X_BA = {Quaterniond::Identity(), {0, 0, 0.035}};
  Sweep sweep = {X_BA, X_BA, 1e-5};
  BvhTraversal traversal;
  VisitBudget budget = {1000000};
  CHECK(traversal.find(a.bvh, b.bvh, sweep, budget));
  const std::size_t all = traversal.size();
  sweep.all_pairs = false;
  CHECK(traversal.find(a.bvh, b.bvh, sweep, budget));
  CHECK(traversal.size() * 4 < all);
  const auto has = [](const std::array<std::uint32_t, 3>& features) {
    return features != std::array{MeshSurface::kNone, MeshSurface::kNone, MeshSurface::kNone};
  };
  std::set<std::uint32_t> corners;
  for (const TrianglePair& pair : traversal) {
    const auto& fa = a.surface.features()[pair.a];
    const auto& fb = b.surface.features()[pair.b];
    CHECK((has(fa.vertices) || has(fb.vertices) || (has(fa.edges) && has(fb.edges))));
    for (const std::uint32_t v : fa.vertices)
      if (v != MeshSurface::kNone) corners.insert(v);
  }
  CHECK(corners.size() == 4);  // corners of the cube's lower face
}

TEST_CASE("a traversal stops at the end of its budget and reports it", "[bvh_traversal]") {
  const MeshBvh a(make_mesh({"peg", 1000})), b(make_mesh({"hole", 2000}));
  const Sweep sweep = {Pose{Quaterniond::Identity(), {3e-4, 0, 0}},
                       Pose{Quaterniond::Identity(), {3e-4, 0, 0}}};
  BvhTraversal traversal;
  VisitBudget plenty = {1000000};
  REQUIRE(traversal.find(a.bvh, b.bvh, sweep, plenty));
  const std::uint32_t needed = 1000000 - plenty.remaining;
  CHECK(needed > 100);
  VisitBudget enough = {needed}, short_of_one = {needed - 1};
  CHECK(traversal.find(a.bvh, b.bvh, sweep, enough));
  CHECK(enough.remaining == 0);
  CHECK_FALSE(traversal.find(a.bvh, b.bvh, sweep, short_of_one));
}

}  // namespace
TEST_CASE("from the front of a closed surface the pairs of the solid are listed, on every processor",
          "[bvh_traversal]") {
  RandomValues random(27);
  BvhTraversal fastest, portable(simd::traverse_portable);
  const MeshBvh tool(make_mesh({"bumpy", 2000}));
  const TriangleMesh mesh = make_mesh({"boulder", 3000});
  const MeshBvh solid(mesh, BodyKind::solid), surface(mesh, BodyKind::surface);
  REQUIRE(surface.surface.is_closed());
  const auto listed = [&](BvhTraversal& traversal, const MeshBvh& b, const Pose& X_BA, unsigned sides) {
    VisitBudget budget = {1000000000};
    Sweep sweep = {X_BA, X_BA, 0.002, false};
    sweep.sides_b = sides;
    REQUIRE(traversal.find(tool.bvh, b.bvh, sweep, budget));
    PairSet out;
    for (const TrianglePair& pair : traversal) out.insert({pair.a, pair.b});
    return out;
  };
  std::size_t more_pairs = 0, from_back = 0;
  for (int n = 0; n < 20; ++n) {
    const Pose X_BA = near_pose(random, tool, solid);
    for (BvhTraversal* traversal : {&fastest, &portable}) {
      const auto of_solid = listed(*traversal, solid, X_BA, MeshSurface::kBothSides);
      const auto front = listed(*traversal, surface, X_BA, MeshSurface::kFront);
      for (const auto& pair : front) CHECK(of_solid.count(pair) == 1);
      // A solid keeps a few tips of pits, which no body can touch.
      CHECK(front.size() >= of_solid.size() - of_solid.size() / 50);
      const auto both = listed(*traversal, surface, X_BA, MeshSurface::kBothSides);
      more_pairs += both.size() - of_solid.size();
      const auto back = listed(*traversal, surface, X_BA, MeshSurface::kBack);
      from_back += back.size();
      for (const auto& pair : back) CHECK(both.count(pair) == 1);
    }
  }
  CHECK(more_pairs > 0);
  CHECK(from_back > 0);
}

}  // namespace wrenchd::test_bvh_traversal
