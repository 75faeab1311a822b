// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "core/frame.hpp"

namespace wrenchd {

/// CGAL's AABB tree over the triangles of a mesh (CGAL::AABB_tree, kernel EPICK). Immutable after
/// construction; several threads may query it. Not RT-safe: queries allocate.
class CgalMeshTree {
 public:
  /// A triangle of the tool (a) and a triangle of this tree (b).
  struct Pair {
    std::uint32_t a, b;
  };

  /// Keeps a reference to the surface, which must outlive this object. Takes about a second for a million
  /// triangles.
  explicit CgalMeshTree(const MeshSurface& surface);
  ~CgalMeshTree();
  CgalMeshTree(const CgalMeshTree&) = delete;
  CgalMeshTree& operator=(const CgalMeshTree&) = delete;

  /// Returns the tree of a surface. All users of a surface share one tree, which lives as long as they do.
  static std::shared_ptr<const CgalMeshTree> of(const MeshSurface& surface);

  const MeshSurface& surface() const noexcept { return surface_; }

  /// Appends all pairs of triangles that may come closer than margin_m [m] while the tool moves straight from
  /// X_BT_start to X_BT_end in the frame B of this mesh: the box around the path of a, enlarged by the
  /// margin, meets the triangle b. The order depends on the meshes only.
  void find_pairs(const CgalMeshTree& tool, const Frame& X_BT_start, const Frame& X_BT_end, double margin_m,
                  std::vector<Pair>& pairs) const;

  /// Returns true if p is inside a closed surface. Exact: counts the triangles that a segment from p to a
  /// point outside crosses, by orientation predicates. Precondition: the surface does not contain p.
  bool contains(const Vector3d& p_m) const;

 private:
  struct Tree;
  const MeshSurface& surface_;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace wrenchd
