// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "collision/meshes/mesh_bvh.hpp"
#include "collision/scene.hpp"
#include "core/pose.hpp"

// On which sides of closed surfaces the tool is. A surface that is closed and does not intersect itself
// divides space into two parts. A tool of one piece that goes from admissible pose to admissible pose and
// passes through nothing stays in its part. It can meet only those vertices and edges first that are convex
// from there, as on a solid. core/METHOD.md, section 14.10.

namespace wrenchd {

/// Returns the side of a surface on which a point is: MeshSurface::kFront or kBack; kBothSides if rounding
/// does not allow to tell. p: in the frame of the mesh [m]. Precondition: mesh.divides_space. RT-safe: takes
/// some microseconds.
unsigned side_of_point(const MeshBvh& mesh, const Vector3d& p) noexcept;

/// The sides of all mesh obstacles of a scene. Finds the side of an obstacle when it is asked for the first
/// time.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe.
class SurfaceSides {
 public:
  /// Keeps a reference to the scene, which must outlive this object. motion_is_continuous: false if the tool
  /// may be at any admissible pose next; then the tool can meet all surfaces from both sides. Not RT-safe:
  /// allocates.
  SurfaceSides(const Scene& scene, bool motion_is_continuous);

  /// Sets a pose that is admissible at scene time time_s [s].
  void set_admissible(const Pose& X_WT, double time_s) noexcept {
    X_WT_ = X_WT;
    time_s_ = time_s;
  }
  /// Forgets all sides: the tool was placed elsewhere.
  void forget() noexcept;

  /// Returns the sides from which the tool can meet an obstacle. number: index in scene.meshes().
  unsigned of(std::uint32_t number) noexcept;
  /// Returns true if the tool is on one side of an obstacle that was asked for.
  bool any_known() const noexcept { return any_known_; }

 private:
  const Scene& scene_;
  bool can_know_;
  Pose X_WT_;
  double time_s_ = 0.0;
  std::vector<std::uint8_t> sides_;  ///< one entry for each obstacle; 0: not asked for yet
  bool any_known_ = false;
};

}  // namespace wrenchd
