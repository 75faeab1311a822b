// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/triangle_bvh.hpp"
#include "tests/support/case_count.hpp"

namespace wrenchd::test_triangle_bvh {

namespace {

using Kind = MeshSurface::Kind;

struct Count {
  std::vector<int> visited;
  double worst_outside_m = 0.0;
};

/// Every triangle under a box lies in the box and in all boxes above.
void descend(const TriangleBvh& bvh, const MeshSurface& surface, std::uint32_t node,
             std::vector<std::uint32_t> above, Count& count) {
  for (std::uint32_t i = 0; i < 8; ++i) {
    const TriangleBvh::Box& box = bvh.boxes()[8 * node + i];
    if (box.count < 0) continue;
    std::vector<std::uint32_t> path = above;
    path.push_back(8 * node + i);
    if (box.count == 0) {
      descend(bvh, surface, box.child, path, count);
      continue;
    }
    for (int lane = 0; lane < box.count; ++lane) {
      const std::uint32_t t = bvh.leaves()[box.child].triangle[lane];
      ++count.visited[t];
      for (const std::uint32_t b : path) {
        const auto& [centre, axis, half, size, child, n, features] = bvh.boxes()[b];
        const Vector3d u(axis[0][0], axis[0][1], axis[0][2]), v(axis[1][0], axis[1][1], axis[1][2]);
        const std::array<Vector3d, 3> axes = {u, v, u.cross(v)};
        for (int k = 0; k < 3; ++k) {
          const Vector3d d = bvh.R_SM() * surface.corner_m(t, k) - Vector3d(centre[0], centre[1], centre[2]);
          for (std::size_t j = 0; j < 3; ++j)
            count.worst_outside_m = std::max(count.worst_outside_m, std::abs(d.dot(axes[j])) - half[j]);
        }
        if (surface.features()[t].vertices !=
            std::array{MeshSurface::kNone, MeshSurface::kNone, MeshSurface::kNone})
          CHECK((features & TriangleBvh::kVertices) != 0);
        if (surface.features()[t].edges !=
            std::array{MeshSurface::kNone, MeshSurface::kNone, MeshSurface::kNone})
          CHECK((features & TriangleBvh::kEdges) != 0);
      }
    }
  }
}

TEST_CASE("a BVH contains every triangle once, inside all boxes above it", "[triangle_bvh]") {
  for (const char* kind : {"cube", "plate", "bumpy", "hole", "bolt", "gear"})
    for (const int triangles :
         {12, 500, 6000, test::case_count(60'000)}) {  // the last one: several processors
      INFO(kind << ' ' << triangles);
      const MeshSurface surface(make_mesh({kind, static_cast<std::size_t>(triangles)}), Kind::solid);
      const TriangleBvh bvh(surface);
      Count count{std::vector<int>(surface.triangles().size(), 0)};
      descend(bvh, surface, 0, {}, count);
      CHECK(std::all_of(count.visited.begin(), count.visited.end(), [](int n) { return n == 1; }));
      CHECK(count.worst_outside_m <= 0.0);
      CHECK(static_cast<double>(bvh.leaves().size()) <=
            1.05 * static_cast<double>(surface.triangles().size()) / 8.0 + 1.0);
    }
}

// Around a cylinder a square leaf of four cells is as thick as the arc of two cells is high. A strip of cells
// along the axis is flat. Thin boxes keep two conforming surfaces apart.
TEST_CASE("leaves on a cylinder are strips along its axis", "[triangle_bvh]") {
  constexpr std::uint32_t kAround = 128, kAlong = 32;
  constexpr double kRadius_m = 0.01, kFullTurn_rad = 2.0 * std::numbers::pi;
  TriangleMesh tube;
  for (std::uint32_t i = 0; i <= kAlong; ++i)
    for (std::uint32_t k = 0; k < kAround; ++k) {
      const double angle = kFullTurn_rad * k / kAround;
      tube.vertices_m.push_back({kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), 0.0005 * i});
    }
  for (std::uint32_t i = 0; i < kAlong; ++i)
    for (std::uint32_t k = 0; k < kAround; ++k) {
      const std::uint32_t a = kAround * i + k, b = kAround * i + (k + 1) % kAround;
      tube.triangles.push_back({a, b, b + kAround});
      tube.triangles.push_back({a, b + kAround, a + kAround});
    }
  const TriangleBvh bvh(MeshSurface(tube, Kind::surface));
  double sum_m = 0.0;
  int leaves = 0;
  for (const TriangleBvh::Box& box : bvh.boxes()) {
    if (box.count <= 0) continue;
    sum_m += box.half[2];
    ++leaves;
  }
  const double square_m = 0.5 * kRadius_m * (1.0 - std::cos(kFullTurn_rad / kAround));
  CHECK(leaves == 1024);
  CHECK(sum_m / leaves < 0.25 * square_m);
}

TEST_CASE("the data are oriented as most triangles are", "[triangle_bvh]") {
  const Quaterniond tilt = Quaterniond(0.8, 0.3, -0.2, 0.47).normalized();
  const auto bounds = [&](const char* kind, const Quaterniond& R) {
    TriangleMesh mesh = make_mesh({kind, 600});
    for (Vector3d& p : mesh.vertices_m) p = R * p;
    const TriangleBvh bvh(MeshSurface(mesh, Kind::solid));
    double sum = 0.0;
    for (const TriangleBvh::Leaf& leaf : bvh.leaves())
      for (int lane = 0; lane < TriangleBvh::kWidth; ++lane) {
        if (leaf.low[0][lane] > leaf.high[0][lane]) continue;
        const Vector3d size(leaf.high[0][lane] - leaf.low[0][lane], leaf.high[1][lane] - leaf.low[1][lane],
                            leaf.high[2][lane] - leaf.low[2][lane]);
        sum += size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
      }
    return sum;
  };
  for (const char* kind : {"cube", "dowel", "gear", "plate"}) {
    INFO(kind);
    CHECK(bounds(kind, tilt) < 1.05 * bounds(kind, Quaterniond::Identity()));
  }
  CHECK(TriangleBvh(MeshSurface(make_mesh({"cube", 600}), Kind::solid)).R_SM().coeffs() ==
        Quaterniond::Identity().coeffs());
}

TEST_CASE("a BVH without triangles is empty", "[triangle_bvh]") {
  const TriangleBvh bvh(MeshSurface(TriangleMesh{}, Kind::surface));
  CHECK(bvh.nodes().empty());
}

}  // namespace
}  // namespace wrenchd::test_triangle_bvh
