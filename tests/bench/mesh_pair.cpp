// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/mesh_pair.hpp"

#include <algorithm>
#include <cmath>

#include "tests/support/manipulation_case.hpp"

namespace wrenchd::bench {
namespace {

Scene scene_of(const GeneratedMesh& tool, const GeneratedMesh& obstacle) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({obstacle.kind, MeshBvh(make_mesh(obstacle)), Pose{}});
  return Scene(test::mesh_tool(make_mesh(tool)), {}, {}, std::move(obstacles));
}

/// Bisects between a free and an overlapping distance. Returns the largest free distance found.
template <class Overlap>
double touching(double free, double overlapping, const Overlap& overlap) {
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (free + overlapping);
    (overlap(middle) ? overlapping : free) = middle;
  }
  return free;
}

constexpr int kTicksBefore = 100;

/// Returns the path parameter of pose i in seconds. The path accelerates uniformly from rest until pose 0 and
/// is uniform after it.
double path_s(int i) {
  const double before = std::max(0.0, 1.0 + static_cast<double>(i) / kTicksBefore);
  return i >= 0 ? i / 1000.0 : 0.5 * kTicksBefore / 1000.0 * (before * before - 1.0);
}

}  // namespace

std::size_t intersecting_pair_count(IntersectingPairs& pairs, const Scene& scene, const Pose& X_WT) {
  pairs.find(*scene.tool_mesh(), *scene.meshes()[0].mesh, X_WT);
  return pairs.pairs().size();
}

MeshPair sliding_bumps(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses) {
  MeshPair pair{"", scene_of({"bumpy", tool_triangles, 1}, {"boulder", obstacle_triangles, 2}), {}, {}, {}};
  IntersectingPairs pairs;
  double last_m = 0.13;
  for (int i = -kTicksBefore; i < static_cast<int>(poses); ++i) {
    const double t = path_s(i);
    const Vector3d out =
        Vector3d(std::cos(t + 0.3), std::sin(t + 0.3) * std::cos(0.7 * t), 0.4 * std::sin(1.7 * t) + 0.2)
            .normalized();
    const Vector3d axis = Vector3d(0.3 + 0.2 * std::sin(t), 1.0, 0.5 * std::cos(t)).normalized();
    const Quaterniond R = rotation_from((t + 0.15 * std::sin(9.0 * t)) * axis);
    const auto at = [&](double away_m) { return Pose{R, away_m * out}; };
    const auto overlap = [&](double away_m) {
      return intersecting_pair_count(pairs, pair.scene, at(away_m)) > 0;
    };
    double free_m = last_m + 0.002, overlapping_m = free_m;
    while (!overlap(overlapping_m)) {
      free_m = overlapping_m;
      overlapping_m -= 0.0005;
    }
    last_m = touching(free_m, overlapping_m, overlap);
    if (i == -kTicksBefore) pair.X_start = at(last_m + 1e-4);
    (i < 0 ? pair.X_WP_before : pair.X_WP).push_back(at(last_m - 0.00025 - 0.0002 * std::sin(25.0 * t)));
  }
  return pair;
}

MeshPair peg_in_hole(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses) {
  MeshPair pair{"", scene_of({"peg", tool_triangles}, {"hole", obstacle_triangles}), {}, {}, {}};
  IntersectingPairs pairs;
  for (int i = -kTicksBefore; i < static_cast<int>(poses); ++i) {
    const double t = path_s(i);
    const Quaterniond R =
        rotation_from(0.0015 * std::sin(6.0 * t) * Vector3d(std::cos(3.0 * t), std::sin(3.0 * t), 0.0)) *
        rotation_from(Vector3d(0.0, 0.0, 0.8 * t));
    const auto at = [&](double aside_m) {
      return Pose{R, {aside_m * std::cos(4.0 * t), aside_m * std::sin(4.0 * t), 0.010 * std::sin(5.0 * t)}};
    };
    const auto overlap = [&](double aside_m) {
      return intersecting_pair_count(pairs, pair.scene, at(aside_m)) > 0;
    };
    double free_m = 0.0, overlapping_m = 0.0;
    while (!overlap(overlapping_m)) {
      free_m = overlapping_m;
      overlapping_m += 2e-5;
    }
    if (i == -kTicksBefore) pair.X_start = at(0.0);
    (i < 0 ? pair.X_WP_before : pair.X_WP)
        .push_back(at(touching(free_m, overlapping_m, overlap) + 0.00005 + 0.00003 * std::sin(25.0 * t)));
  }
  return pair;
}

}  // namespace wrenchd::bench
