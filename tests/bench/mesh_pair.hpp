// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/intersecting_pairs.hpp"
#include "collision/scene.hpp"
#include "tests/support/conforming_case.hpp"

namespace wrenchd::bench {

/// A tool that moves in contact with an obstacle; consecutive poses are 1 ms apart.
struct MeshPair {
  std::string name;
  Scene scene;
  /// The meshes of the bodies as their files contain them, in T and in the obstacle's frame O. The scene may
  /// hold simpler ones.
  std::shared_ptr<const MeshBvh> tool_T, obstacle_O;
  Pose X_OW;                      ///< inverse pose of the obstacle
  std::vector<Pose> X_WP;         ///< commanded poses, overlapping by some tenths of a millimetre
  std::vector<Pose> X_WP_before;  ///< approach to X_WP: the hand accelerates from rest within 0.1 s
  Pose X_start;                   ///< admissible pose near the first pose of the approach
};

/// A bumpy body of 40 mm slides and rotates on a boulder of 60 mm at about 100 mm/s and 1 rad/s, 0.05 to 0.45
/// mm deep.
MeshPair sliding_bumps(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses);

/// A rod of 9.8 mm radius in a tube of 10 mm radius. The rod tilts, spins, slides along the tube and presses
/// on its wall, 20 to 80 um deep. Tens of thousands of triangles stay close to each other.
MeshPair peg_in_hole(std::size_t tool_triangles, std::size_t obstacle_triangles, std::size_t poses);

/// A conforming case: the cube slides and turns on the slab, the shaft tilts, slides and spins in the bore,
/// the gear rolls on the other, all 0.05 to 0.45 mm deep and tilted by milliradians.
MeshPair conforming_pair(const test::ConformingCase& of, std::size_t poses);

/// Returns the number of intersecting triangle pairs of the files' meshes. Searches without history.
std::size_t intersecting_pair_count(IntersectingPairs& pairs, const MeshPair& pair, const Pose& X_WT);

}  // namespace wrenchd::bench
