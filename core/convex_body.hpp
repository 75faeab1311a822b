// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// A convex polyhedron in its own frame T: vertices, and for each vertex its neighbours in order around it
/// (the sequence N_v of the paper, section 3.3). Constant after compute_derived_data().
struct ConvexBody {
  /// A face plane; the solid lies in n . x <= offset. Coplanar triangles form one face.
  struct Face {
    Vector3d n;  ///< unit normal, outward
    double offset_m;
  };
  /// A convex edge between two faces. A plane with outward normal m supports the body along this edge if m is
  /// perpendicular to d, m . side[0] >= 0 and m . side[1] >= 0. Then m lies between the two face normals.
  struct Edge {
    std::uint32_t from, to;
    Vector3d d;  ///< unit direction from vertex `from` to vertex `to`
    Vector3d side[2];
  };

  std::vector<Vector3d> vertices_T_m;
  /// Start index of each vertex's neighbours: vertex i has ring[ring_begin[i]] to ring[ring_begin[i + 1] -
  /// 1].
  std::vector<std::uint32_t> ring_begin;
  std::vector<std::uint32_t> ring;
  std::vector<Face> faces;
  std::vector<Edge> edges;
  /// start index of each vertex's faces in faces_at, same layout as ring_begin
  std::vector<std::uint32_t> faces_begin;
  std::vector<std::uint32_t> faces_at;
  /// start index of each vertex's edges in edges_at, same layout as ring_begin
  std::vector<std::uint32_t> edges_begin;
  std::vector<std::uint32_t> edges_at;

  std::span<const std::uint32_t> ring_of(std::size_t vertex) const noexcept {
    return adjacency_row(vertex, ring_begin, ring);
  }
  std::span<const std::uint32_t> faces_of(std::size_t vertex) const noexcept {
    return adjacency_row(vertex, faces_begin, faces_at);
  }
  std::span<const std::uint32_t> edges_of(std::size_t vertex) const noexcept {
    return adjacency_row(vertex, edges_begin, edges_at);
  }

  /// Computes faces, edges, the faces and edges at each vertex, and the sphere hierarchy of support() from
  /// vertices and rings. Not RT-safe: allocates.
  void compute_derived_data();

  /// Index of the vertex farthest along `direction`, which may have any length. near: a vertex that is likely
  /// to be far along it; a good guess saves time. RT-safe.
  std::uint32_t support(const Vector3d& direction) const noexcept;
  std::uint32_t support(const Vector3d& direction, std::uint32_t near) const noexcept;

  /// Calls visit(vertex, direction . p) for every vertex with direction . p > least(), and for some others.
  /// least() may increase between calls. RT-safe if least and visit are.
  template <class Least, class Visit>
  void visit_above(const Vector3d& direction, const Least& least, const Visit& visit) const noexcept {
    const bool one = blocks_.size() == 1;
    const double length = one ? 0.0 : direction.norm();
    for (std::size_t k = 0; k < blocks_.size();) {
      const Block& block = blocks_[k];
      if (!one && direction.dot(block.centre_m) + length * block.radius_m < least()) {
        k = block.skip_to;
        continue;
      }
      ++k;
      for (std::uint32_t i = block.begin; i < block.end; ++i) visit(order_[i], direction.dot(ordered_m_[i]));
    }
  }

 private:
  /// Node of a bounding sphere hierarchy. A leaf contains the vertices begin to end of order_. An inner node
  /// has begin == end and bounds the nodes that follow it up to skip_to.
  struct Block {
    Vector3d centre_m;
    double radius_m;
    std::uint32_t begin, end;  ///< first and one past the last vertex, as indices into order_
    std::uint32_t skip_to;     ///< index of the next node if none of this node's vertices can qualify
  };

  static std::span<const std::uint32_t> adjacency_row(std::size_t vertex,
                                                      const std::vector<std::uint32_t>& begin,
                                                      const std::vector<std::uint32_t>& all) noexcept {
    return std::span(all).subspan(begin[vertex], begin[vertex + 1] - begin[vertex]);
  }
  void build_blocks(std::uint32_t begin, std::uint32_t end);
  void add_edge(std::uint32_t from, std::uint32_t to, std::span<const std::uint32_t> faces_from,
                std::span<const std::uint32_t> faces_to);

  std::vector<std::uint32_t> order_;  ///< vertex indices, sorted by leaf
  std::vector<Vector3d> ordered_m_;   ///< positions of the vertices in the order of order_ [m]
  std::vector<Block> blocks_;
};

}  // namespace wrenchd
