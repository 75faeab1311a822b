// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A triangle mesh prepared for contact queries: planes of the triangles, and the vertices and edges that can
/// meet another body first. All data are in the mesh's own frame, in metres. Immutable after construction.
///
/// Two bodies that approach each other meet first in a vertex and a face, or in two edges. A *convex vertex*
/// can be first: a plane through it leaves all its neighbours on one side. A *convex edge* can be first: the
/// angle between its two faces is convex. All other vertices and edges (inside a flat region, along a groove,
/// on a saddle) follow after another contact. They never hold a contact. So a face of a thousand triangles
/// behaves like one face.
///
/// A mesh that is open or intersects itself has no inside. It is a surface with two sides, and a tool may be
/// on either of them. The faces at an edge divide the space around it into sectors. Only a tool in a sector
/// of more than 180 degrees can meet the edge first, so an edge is convex seen from at most one sector. The
/// rule also holds at the border (one face), at edges of three or more faces, and where the faces are wound
/// against each other. A vertex of a surface is convex if a plane through it leaves all its neighbours on one
/// side, whichever side that is: core/METHOD.md, section 14.10.
///
/// Construction is not RT-safe: it may take seconds. Accessors are RT-safe.
class MeshSurface {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  /// The plane n . x = offset_m with the outward unit normal n. Coplanar triangles of one region share the
  /// same plane bit for bit.
  struct Plane {
    Vector3d normal;
    double offset_m;
  };
  struct Edge {
    std::array<std::uint32_t, 2> vertices;
    /// The two faces beside the sector from which the edge is convex. The first one traverses the edge from
    /// vertices[0] to vertices[1]. The second is kNone at the border of a surface, and where all faces lie on
    /// each other.
    std::array<std::uint32_t, 2> triangles;
    /// +1 or -1 for each face: the factor that turns its plane's normal into that sector. 1 for a solid.
    std::array<std::int32_t, 2> sides;

    bool is_border() const noexcept { return triangles[1] == kNone; }
  };
  /// The features that a triangle owns. Each convex vertex and each convex edge has one owner, so that each
  /// pair of features occurs in one pair of triangles only. kNone: no feature.
  struct Features {
    std::array<std::uint32_t, 3> vertices;
    std::array<std::uint32_t, 3> edges;
  };
  using Kind = BodyKind;
  /// The sides of a surface, as bits. The front is the side to which the normals of the faces point. A solid
  /// has a front only.
  static constexpr unsigned kFront = 1, kBack = 2, kBothSides = 3;

  MeshSurface() = default;  ///< empty; the mesh cache fills it through visit_members()
  MeshSurface(TriangleMesh mesh, Kind kind);

  Kind kind() const noexcept { return kind_; }
  const std::vector<Vector3d>& vertices_m() const noexcept { return mesh_.vertices_m; }
  const std::vector<std::array<std::uint32_t, 3>>& triangles() const noexcept { return mesh_.triangles; }
  const TriangleMesh& mesh() const noexcept { return mesh_; }
  const std::vector<Plane>& planes() const noexcept { return planes_; }
  const std::vector<Features>& features() const noexcept { return features_; }
  const std::vector<Edge>& convex_edges() const noexcept { return convex_edges_; }

  /// Returns corner i of a triangle [m]. RT-safe.
  const Vector3d& corner_m(std::uint32_t triangle, int i) const noexcept {
    return mesh_.vertices_m[mesh_.triangles[triangle][static_cast<std::size_t>(i)]];
  }
  /// Returns the neighbours of a convex vertex; empty for all other vertices. RT-safe.
  std::span<const std::uint32_t> ring_of(std::uint32_t vertex) const noexcept {
    return std::span(ring_).subspan(ring_begin_[vertex], ring_begin_[vertex + 1] - ring_begin_[vertex]);
  }
  /// Returns a vector, not of unit length, from a convex edge to the middle of the sector from which it is
  /// convex. Precondition: not a border edge. RT-safe.
  Vector3d outward(const Edge& edge) const noexcept {
    return edge.sides[0] * planes_[edge.triangles[0]].normal +
           edge.sides[1] * planes_[edge.triangles[1]].normal;
  }
  /// Returns the sides from which a tool can meet a convex edge first. A surface that is not closed has no
  /// front: both sides. RT-safe.
  unsigned sides_of(const Edge& edge) const noexcept {
    if (!is_closed_) return kind_ == Kind::solid ? kFront : kBothSides;
    return edge.sides[0] > 0 ? kFront : kBack;
  }
  /// Returns the sides from which a tool can meet a convex vertex first. Precondition: the vertex is convex.
  /// RT-safe.
  unsigned sides_of_vertex(std::uint32_t vertex) const noexcept {
    if (!is_closed_) return kind_ == Kind::solid ? kFront : kBothSides;
    return vertex_sides_[vertex];
  }
  /// Returns the angle of a triangle at one of its vertices [rad]. RT-safe.
  double angle_at(std::uint32_t triangle, std::uint32_t vertex) const noexcept;
  /// Returns true for a surface of one piece without border whose faces are wound alike. If it does not
  /// intersect itself, it divides space: a tool of one piece that it does not intersect is on one of its
  /// sides. RT-safe.
  bool is_closed() const noexcept { return is_closed_; }
  /// Returns the triangle across the side from corner `side` to the next corner; kNone at a border and where
  /// more than two faces meet. RT-safe.
  std::uint32_t neighbour(std::uint32_t triangle, std::size_t side) const noexcept {
    return neighbours_[triangle][side];
  }
  /// Returns true if the neighbour across a side traverses that side in the opposite direction, as in a
  /// consistently oriented mesh. RT-safe.
  bool is_wound_alike(std::uint32_t triangle, std::size_t side, std::uint32_t other) const noexcept;
  /// Returns the region of a triangle. Adjacent coplanar triangles have the same region. RT-safe.
  std::uint32_t planar_region(std::uint32_t triangle) const noexcept { return planar_region_[triangle]; }

  /// Largest distance of a vertex from the origin of the mesh's frame [m].
  double radius_m() const noexcept { return radius_m_; }

  /// Calls use(member) for each data member, for the mesh cache (mesh_cache.hpp).
  template <class Use>
  void visit_members(const Use& use) {
    use(mesh_.vertices_m), use(mesh_.triangles), use(kind_), use(neighbours_), use(planes_),
        use(planar_region_);
    use(features_), use(convex_edges_), use(ring_begin_), use(ring_), use(vertex_sides_);
    use(is_closed_), use(radius_m_);
  }

 private:
  using Corners = std::array<std::uint32_t, 3>;
  struct TriangleSide {
    std::uint32_t triangle;
    std::uint8_t side;  ///< the side from corner `side` to the next corner
  };
  /// The sides at an edge of three or more faces.
  using CrowdedEdge = std::vector<TriangleSide>;

  std::vector<CrowdedEdge> find_neighbours();
  bool find_closed(const std::vector<CrowdedEdge>& crowded) const;
  void find_planes();
  void find_convex_edges(const std::vector<CrowdedEdge>& crowded);
  void find_convex_vertices();
  bool is_wound_alike(TriangleSide side, std::uint32_t other) const noexcept {
    return is_wound_alike(side.triangle, side.side, other);
  }
  double height_beyond_m(TriangleSide side, std::uint32_t other) const noexcept;
  void add_edge(TriangleSide side, std::uint32_t other, std::array<std::int32_t, 2> sides);
  void add_edge_of_surface(TriangleSide side, std::uint32_t other);
  void add_crowded_edge(const CrowdedEdge& faces);

  TriangleMesh mesh_;
  Kind kind_ = Kind::solid;
  /// neighbour across the side from corner i to corner i + 1; kNone: no neighbour, or more than one
  std::vector<Corners> neighbours_;
  std::vector<Plane> planes_;
  std::vector<std::uint32_t> planar_region_;  ///< number of the triangle that defines the region's plane
  std::vector<Features> features_;
  std::vector<Edge> convex_edges_;
  std::vector<std::uint32_t> ring_begin_;
  std::vector<std::uint32_t> ring_;
  std::vector<std::uint8_t> vertex_sides_;  ///< sides of each convex vertex of a closed surface
  bool is_closed_ = false;
  double radius_m_ = 0.0;
};

}  // namespace wrenchd
