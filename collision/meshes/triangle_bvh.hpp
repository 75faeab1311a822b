// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A hierarchy of oriented boxes over the triangles of a mesh, eight to a node, with up to eight triangles in
/// a leaf: one box against eight, one triangle against eight, is what the walk
/// (collision/pairs/bvh_traversal.hpp) does at a time.
///
/// Boxes and triangles know whether there are pointed vertices and sharp edges in them (mesh_surface.hpp):
/// two that have none between them cannot be the first to meet.
///
/// Single precision, for what it leaves out is left out by a margin; what it lets through is looked at again
/// in double precision by whoever asked. Built once, then only read.
class TriangleBvh {
 public:
  static constexpr int kWidth = 8;

  /// A box by itself, to be moved and held against the eight of a node. One cache line.
  struct alignas(64) Box {
    float centre[3];
    float axis[2][3];  ///< unit; the third is their cross product
    float half[3];     ///< half its size along each axis
    float half_area;   ///< half its area: the larger of two boxes is opened first
    std::uint32_t child;
    std::int16_t count;      ///< of triangles in the leaf `child`; 0: `child` is a node; -1: there is no box
    std::uint16_t features;  ///< kVertices, kEdges: what triangles in it speak for
  };
  static constexpr std::uint16_t kVertices = 1, kEdges = 2;
  /// The same eight boxes side by side.
  struct alignas(64) Node {
    float centre[3][kWidth];
    float axis[3][3][kWidth];  ///< [which][component]
    float half[3][kWidth];
    std::uint32_t has_vertices, has_edges;  ///< a bit for each box
  };
  /// Up to eight triangles side by side. Lanes without one hold a box that nothing meets.
  struct alignas(64) Leaf {
    float corner[3][3][kWidth];  ///< [which][component]
    float low[3][kWidth];        ///< bounds of each triangle
    float high[3][kWidth];
    float bounds_low[3], bounds_high[3];
    float normal[3][kWidth];  ///< of its plane, outward unit
    float offset[kWidth];     ///< normal . corner
    std::uint32_t triangle[kWidth];
    std::uint32_t has_vertices, has_edges;  ///< a bit for each triangle
  };

  TriangleBvh() = default;  ///< of nothing, to be filled in by each_member()
  explicit TriangleBvh(const MeshSurface& surface);

  /// Number i of node n is boxes()[8 n + i]. Node 0 is the root; there is none in a tree without triangles.
  const std::vector<Box>& boxes() const noexcept { return boxes_; }
  const std::vector<Node>& nodes() const noexcept { return nodes_; }
  const std::vector<Leaf>& leaves() const noexcept { return leaves_; }
  /// Bound of the coordinates: single precision rounds them by 6e-8 of it [m].
  float extent_m() const noexcept { return extent_m_; }
  std::size_t bytes() const noexcept;

  /// Calls use(member) for all that it holds: how it is kept on disk (collision/meshes/mesh_cache.hpp).
  template <class Use>
  void visit_members(const Use& use) {
    use(boxes_), use(nodes_), use(leaves_), use(extent_m_);
  }

 private:
  std::vector<Box> boxes_;
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
  float extent_m_ = 0.0F;
};

}  // namespace wrenchd
