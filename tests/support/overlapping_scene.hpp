// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "collision/scene.hpp"
#include "tests/support/random_body.hpp"
#include "tests/support/separation.hpp"

namespace wrenchd::test {

/// A scene and a pose at which its tool overlaps an obstacle.
struct OverlappingScene {
  Scene scene;
  Pose X_WP;
};

/// Returns a random body that overlaps a random half-space by a depth between least_m and most_m.
inline OverlappingScene overlap_half_space(RandomValues& random, double least_m, double most_m,
                                           double least_axis = 0.2) {
  const Vector3d n = random.unit<3>();
  Scene scene(random_body(random, random.integer(5, 30), least_axis), {half_space(n, random.normal())});
  Pose X_WP{random.rotation(), random.vector<3>()};
  X_WP.translation_m -= (least_gap_m(scene, X_WP) + random.uniform(least_m, most_m)) * n;
  return {std::move(scene), X_WP};
}

/// Returns a random body that overlaps walls through the origin by about depth_m each.
inline OverlappingScene overlap_corner(RandomValues& random, int half_spaces, double depth_m) {
  std::vector<HalfSpaceSettings> walls;
  for (int i = 0; i < half_spaces; ++i) walls.push_back(half_space(random.unit<3>(), 0.0));
  Scene scene(random_body(random, random.integer(6, 20), 0.4), walls);
  Pose X_WP{random.rotation(), Vector3d::Zero()};
  for (int round = 0; round < 20; ++round)
    for (const HalfSpaceSettings& wall : walls)
      X_WP.translation_m -= (least_gap_m(Scene(scene.tool(), {wall}), X_WP) + depth_m) * wall.normal_W;
  return {std::move(scene), X_WP};
}

/// Returns two random convex bodies that overlap by depth_m along their separating axis.
inline OverlappingScene overlap_body(RandomValues& random, double depth_m) {
  ToolBody tool = random_body(random, random.integer(6, 14));
  const ToolBody other = random_body(random, random.integer(6, 14));
  OverlappingScene met{Scene(std::move(tool), {}, {convex_obstacle("other", other.hull)}), {}};
  met.X_WP.rotation = random.rotation();
  const Vector3d direction = random.unit<3>();
  double near = 0.0;
  double far = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (near + far);
    met.X_WP.translation_m = middle * direction;
    (separation_m(met.scene, met.X_WP) < -depth_m ? near : far) = middle;
  }
  return met;
}

}  // namespace wrenchd::test
