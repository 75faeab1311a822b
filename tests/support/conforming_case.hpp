// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

/// Two bodies that touch face to face. C: frame of the tool's shape, with its origin in the middle.
enum class ConformingShape : std::uint8_t {
  cube_on_slab,    ///< cube of 50 mm on a slab of 300 x 300 x 20 mm, top at z = 0
  shaft_in_bore,   ///< shaft of radius 9.9 mm and length 60 mm in a bore of length 50 mm
  shaft_inserted,  ///< the same bodies with chamfers; the shaft goes into the bore and out again
  gears,           ///< two gears with 20 teeth, radius 23 mm, 10 mm thick
  peg_in_hole,     ///< the bumpy peg and hole of tools/bench
};

/// The tessellation of curved bodies.
enum class Profile : std::uint8_t {
  faceted,  ///< few corners; fine triangles divide flat facets, so each tessellation has the same shape
  smooth,   ///< as many corners as the number of triangles permits
};

struct ConformingCase {
  std::string name;
  ConformingShape shape;
  std::size_t tool_triangles, obstacle_triangles;  ///< approximate
  double clearance_m = 0.0;                        ///< between shaft and bore, at the radius
  Profile profile = Profile::faceted;
  bool in_float = false;  ///< coordinates rounded to float, in millimetres, as a binary STL file has them
  bool rotated = false;   ///< both meshes are rotated in their files, so that no face is axis-parallel
};

/// The cases: cube, shaft and gears at 10k to 1M triangles, exact and in float, axis-parallel and rotated.
const std::vector<ConformingCase>& conforming_cases();

/// Returns the case of this name. Throws std::invalid_argument if there is none.
const ConformingCase& conforming_case(const std::string& name);

struct MeshesOfCase {
  TriangleMesh tool, obstacle;  ///< in metres, in the frames C and W
};

/// Returns the meshes before rotation and rounding. Not RT-safe: allocates.
MeshesOfCase fine_meshes(const ConformingCase& of);

/// Returns meshes of the same shape with the fewest triangles. The bodies of peg_in_hole have no coarser
/// mesh, so for them it returns the fine ones. Not RT-safe: allocates.
MeshesOfCase coarse_meshes(const ConformingCase& of);

/// Returns the rotation of a mesh in its file: X_FC of a rotated case, else the identity.
Quaterniond file_rotation(const ConformingCase& of);

/// The commanded poses X_WC at 1000 poses per second, at most 0.3 m/s and 3 rad/s. The first pose is free,
/// even where the hand presses later. seed: phases of the motion.
std::vector<Pose> conforming_trajectory(const ConformingCase& of, std::size_t ticks, std::uint64_t seed = 1);

}  // namespace wrenchd::test
