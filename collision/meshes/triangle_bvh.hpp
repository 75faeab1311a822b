// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A bounding volume hierarchy of oriented boxes over the triangles of a mesh. Each node has eight children,
/// each leaf up to eight triangles. The traversal (pairs/bvh_traversal.hpp) tests one box against eight
/// boxes, or one triangle against eight triangles, at a time.
///
/// Boxes and triangles state whether they contain convex vertices and convex edges (mesh_surface.hpp), and
/// from which side of the surface these are convex. Two that contain none cannot meet first.
///
/// The data are in a frame S of their own, which has the origin of the mesh's frame M and the axes of most of
/// its triangles. There the bounds of long triangles are small, however the file is oriented.
///
/// The data are in single precision with a margin for rounding. The caller tests the remaining pairs in
/// double precision. Immutable after construction. Construction is not RT-safe: it may take seconds.
/// Accessors are RT-safe.
class TriangleBvh {
 public:
  static constexpr int kWidth = 8;

  /// One box. It has the size of one cache line.
  struct alignas(64) Box {
    float centre[3];
    float axis[2][3];  ///< unit vectors; the third axis is their cross product
    float half[3];     ///< half the length along each axis
    float half_area;   ///< half the surface area; a traversal opens the larger of two boxes first
    std::uint32_t child;
    std::int16_t count;  ///< number of triangles in leaf `child`; 0: `child` is a node; -1: no box
    /// kVertices, kEdges: features that its triangles own and that are convex from the front; shifted by
    /// kBackOfBox: those that are convex from the back
    std::uint16_t features;
  };
  static constexpr std::uint16_t kVertices = 1, kEdges = 2;
  static constexpr unsigned kBackOfBox = 2, kBackOfEight = 8;
  /// Eight boxes as structure of arrays.
  struct alignas(64) Node {
    float centre[3][kWidth];
    float axis[3][3][kWidth];  ///< [axis][component]
    float half[3][kWidth];
    /// one bit for each box; shifted by kBackOfEight: features that are convex from the back
    std::uint32_t has_vertices, has_edges;
  };
  /// Up to eight triangles as structure of arrays. Unused lanes hold a box that overlaps nothing.
  struct alignas(64) Leaf {
    float corner[3][3][kWidth];  ///< [corner][component]
    float low[3][kWidth];        ///< bounds of each triangle
    float high[3][kWidth];
    float bounds_low[3], bounds_high[3];
    float normal[3][kWidth];  ///< outward unit normal of the triangle's plane
    float offset[kWidth];     ///< normal . corner
    std::uint32_t triangle[kWidth];
    /// one bit for each triangle; shifted by kBackOfEight: features that are convex from the back
    std::uint32_t has_vertices, has_edges;
  };

  TriangleBvh() = default;  ///< empty; the mesh cache fills it through visit_members()
  explicit TriangleBvh(const MeshSurface& surface);

  /// Box i of node n is boxes()[8 n + i]. Node 0 is the root. A BVH without triangles has no node.
  const std::vector<Box>& boxes() const noexcept { return boxes_; }
  const std::vector<Node>& nodes() const noexcept { return nodes_; }
  const std::vector<Leaf>& leaves() const noexcept { return leaves_; }
  /// Rotation from the mesh's frame M to the frame S.
  Quaterniond R_SM() const noexcept { return {R_SM_[0], R_SM_[1], R_SM_[2], R_SM_[3]}; }
  /// Bound of the coordinates in S [m]. Single precision rounds them by at most 6e-8 of it.
  float extent_m() const noexcept { return extent_m_; }
  std::size_t bytes() const noexcept;

  /// Calls use(member) for each data member, for the mesh cache (mesh_cache.hpp).
  template <class Use>
  void visit_members(const Use& use) {
    use(boxes_), use(nodes_), use(leaves_), use(R_SM_), use(extent_m_);
  }

 private:
  std::vector<Box> boxes_;
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
  std::array<double, 4> R_SM_ = {1.0, 0.0, 0.0, 0.0};  ///< quaternion w, x, y, z
  float extent_m_ = 0.0F;
};

}  // namespace wrenchd
