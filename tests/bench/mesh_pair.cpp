// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/mesh_pair.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "collision/meshes/mesh_loader.hpp"
#include "tests/support/conforming_scene.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::bench {
namespace {

/// The scene holds the surfaces that the daemon would use.
MeshPair made_pair(const GeneratedMesh& tool, const GeneratedMesh& obstacle) {
  const double tolerance_m = SceneSettings{}.surface_tolerance_m;
  MeshLoader loader;
  ToolBody body = test::mesh_tool(make_mesh(tool));
  const auto tool_T = std::make_shared<const MeshBvh>(body.mesh);
  const auto obstacle_O = std::make_shared<const MeshBvh>(make_mesh(obstacle));
  auto tool_surface = loader.build_bvh(body.mesh, BodyKind::solid, tool.kind, tolerance_m);
  auto obstacle_surface = loader.build_bvh(make_mesh(obstacle), BodyKind::solid, obstacle.kind, tolerance_m);
  std::vector<MeshObstacle> obstacles = {{obstacle.kind, std::move(obstacle_surface), Pose{}}};
  return {"",     Scene(std::move(body), {}, {}, std::move(obstacles), std::move(tool_surface)),
          tool_T, obstacle_O,
          {},     {},
          {},     {}};
}

/// Returns the pair of a scene that was loaded from files, without poses.
MeshPair files_pair(const test::ConformingScene& loaded) {
  TriangleMesh tool_T = loaded.tool_F;
  const Pose X_TF = inverse(loaded.X_FT());
  for (Vector3d& p : tool_T.vertices_m) p = X_TF * p;
  return {"",
          loaded.scene,
          std::make_shared<const MeshBvh>(std::move(tool_T)),
          std::make_shared<const MeshBvh>(loaded.obstacle_F),
          inverse(loaded.X_WF),
          {},
          {},
          {}};
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

std::size_t intersecting_pair_count(IntersectingPairs& pairs, const MeshPair& pair, const Pose& X_WT) {
  pairs.find(*pair.tool_T, *pair.obstacle_O, pair.X_OW * X_WT);
  return pairs.pairs().size();
}

MeshPair sliding_bumps(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses) {
  MeshPair pair = made_pair({"bumpy", tool_triangles, 1}, {"boulder", obstacle_triangles, 2});
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
    const auto overlap = [&](double away_m) { return intersecting_pair_count(pairs, pair, at(away_m)) > 0; };
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
  MeshPair pair = made_pair({"peg", tool_triangles}, {"hole", obstacle_triangles});
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
      return intersecting_pair_count(pairs, pair, at(aside_m)) > 0;
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

namespace {

/// A family of poses of the shape: rotation, a place where the bodies overlap, and the direction that
/// separates them.
struct Approach {
  Quaterniond R;
  Vector3d inside_m, out;
  double free_m;  ///< distance along `out` at which the bodies are apart
};

Approach approach_at(const test::ConformingCase& of, double t) {
  using test::ConformingShape;
  // Half the tilt that the clearance of the bore admits.
  const double tilt_rad = of.clearance_m > 0.0 ? 0.5 * of.clearance_m / 0.03 : 0.0015;
  const Quaterniond tilt =
      rotation_from(tilt_rad * std::sin(6.0 * t) * Vector3d(std::cos(3.0 * t), std::sin(3.0 * t), 0.0));
  const auto about_z = [](double angle) { return rotation_from({0.0, 0.0, angle}); };
  switch (of.shape) {
    case ConformingShape::cube_on_slab:
      return {tilt * about_z(0.8 * t),
              {0.05 * std::sin(2.0 * t), 0.02 * std::sin(3.0 * t), 0.024},
              Vector3d::UnitZ(),
              0.002};
    case ConformingShape::gears: {
      const double roll = 0.6 * std::sin(t), half_tooth = 0.05 * std::numbers::pi;
      return {tilt * about_z(half_tooth + 2.0 * roll),
              {0.039 * std::cos(roll), 0.039 * std::sin(roll), 0.003 * std::sin(5.0 * t)},
              {std::cos(roll), std::sin(roll), 0.0},
              0.008};
    }
    default: {
      const Vector3d aside(std::cos(4.0 * t), std::sin(4.0 * t), 0.0);
      return {tilt * about_z(0.8 * t), 0.001 * aside + Vector3d(0.0, 0.0, 0.010 * std::sin(5.0 * t)), -aside,
              0.001};
    }
  }
}

}  // namespace

MeshPair conforming_pair(const test::ConformingCase& of, std::size_t poses) {
  MeshLoader loader;
  test::ConformingScene fine = test::load_scene(of, test::fine_meshes(of), loader);
  const test::ConformingScene coarse = test::load_coarse_scene(of);
  const MeshPair coarse_pair = files_pair(coarse);
  MeshPair pair = files_pair(fine);
  const bool flat = of.shape == test::ConformingShape::cube_on_slab;
  const Pose X_CT = inverse(fine.X_TC), X_CT_coarse = inverse(coarse.X_TC);
  IntersectingPairs pairs;
  for (int i = -kTicksBefore; i < static_cast<int>(poses); ++i) {
    const double t = path_s(i);
    const Approach path = approach_at(of, t);
    const auto at = [&](double away_m) { return Pose{path.R, path.inside_m + away_m * path.out}; };
    const auto overlap = [&](double away_m) {
      return intersecting_pair_count(pairs, coarse_pair, at(away_m) * X_CT_coarse) > 0;
    };
    const double touching_m = touching(path.free_m, 0.0, overlap);
    if (i == -kTicksBefore) pair.X_start = at(flat ? touching_m + 1e-4 : path.free_m) * X_CT;
    (i < 0 ? pair.X_WP_before : pair.X_WP)
        .push_back(at(touching_m - 0.00025 - 0.0002 * std::sin(25.0 * t)) * X_CT);
  }
  return pair;
}

}  // namespace wrenchd::bench
