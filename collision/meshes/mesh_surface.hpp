// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A triangle mesh as contacts see it: its triangles with their planes, and which of its vertices and edges
/// can meet another body first. All in the mesh's own frame, in metres. Built once, then only read.
///
/// Two bodies that come together meet in a vertex and a face or in two edges, and not every vertex and edge
/// can be the one. A *pointed* vertex can: there is a plane through it that leaves all its neighbours on one
/// side. A *sharp* edge can: its two faces fall away from each other. The rest (edges and vertices within a
/// flat region, along the bottom of a groove, on a saddle) is reached only after something else has met, so
/// it never holds a contact, and a face cut into a thousand triangles feels as one.
///
/// Where a mesh is open or cuts through itself it has no inside. It is a surface then, with two sides, and
/// all its edges and vertices count.
class MeshSurface {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  /// Outward unit normal n, and n . x of the points of the plane [m]. Triangles that lie in one plane have
  /// the same, to the bit.
  struct Plane {
    Vector3d normal;
    double offset_m;
  };
  struct Edge {
    std::array<std::uint32_t, 2> vertices;
    /// The faces along it: counter-clockwise in the first is from vertices[0] to vertices[1]. The second is
    /// kNone on the border of a surface.
    std::array<std::uint32_t, 2> triangles;
  };
  /// The features that a triangle speaks for: each pointed vertex and each sharp edge belongs to one triangle
  /// only, so that a pair of features is met in one pair of triangles. kNone: none.
  struct Features {
    std::array<std::uint32_t, 3> vertices;
    std::array<std::uint32_t, 3> edges;
  };
  using Kind = BodyKind;

  MeshSurface() = default;  ///< of nothing, to be filled in by each_member()
  MeshSurface(TriangleMesh mesh, Kind kind);

  Kind kind() const noexcept { return kind_; }
  const std::vector<Vector3d>& vertices_m() const noexcept { return mesh_.vertices_m; }
  const std::vector<std::array<std::uint32_t, 3>>& triangles() const noexcept { return mesh_.triangles; }
  const TriangleMesh& mesh() const noexcept { return mesh_; }
  const std::vector<Plane>& planes() const noexcept { return planes_; }
  const std::vector<Features>& features() const noexcept { return features_; }
  const std::vector<Edge>& convex_edges() const noexcept { return convex_edges_; }

  /// The corner of a triangle [m]. RT safe.
  const Vector3d& corner_m(std::uint32_t triangle, int i) const noexcept {
    return mesh_.vertices_m[mesh_.triangles[triangle][static_cast<std::size_t>(i)]];
  }
  /// The vertices that share an edge with a pointed vertex; empty for any other. RT safe.
  std::span<const std::uint32_t> ring_of(std::uint32_t vertex) const noexcept {
    return std::span(ring_).subspan(ring_begin_[vertex], ring_begin_[vertex + 1] - ring_begin_[vertex]);
  }
  /// Triangles that lie in one plane, side by side, have the same. RT safe.
  std::uint32_t planar_region(std::uint32_t triangle) const noexcept { return planar_region_[triangle]; }

  /// Farthest vertex from the origin of the mesh's frame [m].
  double radius_m() const noexcept { return radius_m_; }
  std::size_t convex_vertex_count() const noexcept { return convex_vertex_count_; }

  /// Calls use(member) for all that it holds: how it is kept on disk (collision/meshes/mesh_cache.hpp).
  template <class Use>
  void visit_members(const Use& use) {
    use(mesh_.vertices_m), use(mesh_.triangles), use(kind_), use(neighbours_), use(planes_),
        use(planar_region_);
    use(features_), use(convex_edges_), use(ring_begin_), use(ring_), use(radius_m_),
        use(convex_vertex_count_);
  }

 private:
  using Corners = std::array<std::uint32_t, 3>;

  void find_neighbours();
  void find_planes();
  void find_convex_edges();
  void find_convex_vertices();
  bool is_convex_edge(std::uint32_t triangle, int side) const noexcept;

  TriangleMesh mesh_;
  Kind kind_ = Kind::solid;
  std::vector<Corners> neighbours_;  ///< across the side from corner i to corner i + 1; kNone: none
  std::vector<Plane> planes_;
  std::vector<std::uint32_t> planar_region_;  ///< the triangle whose plane it is
  std::vector<Features> features_;
  std::vector<Edge> convex_edges_;
  std::vector<std::uint32_t> ring_begin_;
  std::vector<std::uint32_t> ring_;
  double radius_m_ = 0.0;
  std::size_t convex_vertex_count_ = 0;
};

}  // namespace wrenchd
