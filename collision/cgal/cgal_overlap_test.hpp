// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "collision/cgal/cgal_mesh_tree.hpp"
#include "collision/overlap_test.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// The overlap test on CGAL's AABB trees with exact predicates. Not RT-safe: allocates.
class CgalOverlapTest final : public OverlapTest {
 public:
  /// Keeps a reference to the scene, which must outlive this object.
  explicit CgalOverlapTest(const Scene& scene);

  /// Ends the program if no memory is left.
  bool overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept override;

 private:
  const Scene& scene_;
  std::shared_ptr<const CgalMeshTree> tool_tree_;
  std::vector<std::shared_ptr<const CgalMeshTree>> trees_;  ///< one for each of scene.meshes()
};

}  // namespace wrenchd
