// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "collision/pairs/intersecting_pairs.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Tests single poses for overlap. contact_detection.hpp makes the test of a backend. One object serves one
/// thread.
class OverlapTest {
 public:
  OverlapTest() = default;
  OverlapTest(const OverlapTest&) = delete;
  OverlapTest& operator=(const OverlapTest&) = delete;
  virtual ~OverlapTest() = default;

  /// Returns true if the surfaces of the tool and of an obstacle have a common point, or if one body contains
  /// the other. X_OT: pose of the tool in the obstacle's frame. Not RT-safe: may take milliseconds.
  virtual bool overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept = 0;
};

/// Returns one triangle of each connected shell of a surface. Not RT-safe: allocates.
std::vector<std::uint32_t> shell_triangles(const MeshSurface& surface);

/// The overlap test on wrenchd's BVH.
class NativeOverlapTest final : public OverlapTest {
 public:
  /// Keeps a reference to the scene, which must outlive this object. Not RT-safe: allocates.
  explicit NativeOverlapTest(const Scene& scene);

  /// Neither allocates nor locks.
  bool overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept override;

 private:
  const Scene& scene_;
  std::vector<std::uint32_t> tool_shells_;                       ///< one triangle of each shell of the tool
  std::map<const MeshBvh*, std::vector<std::uint32_t>> shells_;  ///< one triangle of each shell of each mesh
  IntersectingPairs intersecting_pairs_;
};

}  // namespace wrenchd
