// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/intersecting_pairs.hpp"
#include "collision/scene.hpp"

namespace wrenchd::bench {

/// A tool that moves in contact with an obstacle, a millisecond from pose to pose.
struct MeshPair {
  std::string name;
  Scene scene;
  std::vector<Pose> X_WP;         ///< overlapping by some tenths of a millimetre
  std::vector<Pose> X_WP_before;  ///< leading there: a hand comes to speed in a tenth of a second
  Pose X_start;                   ///< admissible, near the first of these
};

/// A bumpy body of 40 mm slides and turns on a boulder of 60 mm, about 100 mm/s and 1 rad/s, 0.05 to 0.45 mm
/// deep.
MeshPair sliding_bumps(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses);

/// A rod of 9.8 mm radius in a tube of 10 mm: it tilts, spins, slides along and is pushed against the wall,
/// 20 to 80 um deep. Tens of thousands of triangles are near each other all the time.
MeshPair peg_in_hole(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses);

/// How many pairs of triangles of tool and obstacle meet, found anew at each pose.
std::size_t intersecting_pair_count(IntersectingPairs& pairs, const Scene& scene, const Pose& X_WT);

}  // namespace wrenchd::bench
