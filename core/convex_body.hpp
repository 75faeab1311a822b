// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// A convex polyhedron in a frame of its own: vertices, and for each vertex its neighbours in order around it
/// (the sequence N_v of section 3.3). Built once, then only read.
struct ConvexBody {
  /// The solid lies in n . x <= offset. Triangles in one plane are one face.
  struct Face {
    Vector3d n;  ///< unit, outward
    double offset_m;
  };
  /// Where two faces meet at an angle. A plane touches the body along the edge where its outward normal m is
  /// at right angles to the edge and m . side[0] >= 0, m . side[1] >= 0: between the normals of the faces.
  struct Edge {
    std::uint32_t from, to;
    Vector3d d;  ///< unit, from `from` to `to`
    Vector3d side[2];
  };

  std::vector<Vector3d> vertices_T_m;
  /// Ring of vertex i: ring[ring_begin[i]] up to ring[ring_begin[i + 1]].
  std::vector<std::uint32_t> ring_begin;
  std::vector<std::uint32_t> ring;
  std::vector<Face> faces;
  std::vector<Edge> edges;
  std::vector<std::uint32_t> faces_begin;  ///< the faces of vertex i, laid out as the rings
  std::vector<std::uint32_t> faces_at;
  std::vector<std::uint32_t> edges_begin;  ///< and its edges
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

  /// Fills in faces, edges, which of them are at which vertex, and what support() works with from vertices
  /// and rings. Not RT safe.
  void compute_derived_data();

  /// The vertex farthest along a direction, of any length. near: one that is known to be far along it, which
  /// saves time. RT safe.
  std::uint32_t support(const Vector3d& direction) const noexcept;
  std::uint32_t support(const Vector3d& direction, std::uint32_t near) const noexcept;

  /// Calls visit(vertex, direction . p) for every vertex that lies higher along the direction than least(),
  /// which may rise meanwhile, and for some others. RT safe if they are.
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
  /// Some vertices that lie close together, in a sphere; or, without vertices of its own, the sphere around
  /// the blocks that follow it up to `after`.
  struct Block {
    Vector3d centre_m;
    double radius_m;
    std::uint32_t begin, end;  ///< in order_
    std::uint32_t skip_to;     ///< the block to look at next where none of these can be the one
  };

  static std::span<const std::uint32_t> adjacency_row(std::size_t vertex,
                                                      const std::vector<std::uint32_t>& begin,
                                                      const std::vector<std::uint32_t>& all) noexcept {
    return std::span(all).subspan(begin[vertex], begin[vertex + 1] - begin[vertex]);
  }
  void build_blocks(std::uint32_t begin, std::uint32_t end);
  void add_edge(std::uint32_t from, std::uint32_t to, std::span<const std::uint32_t> faces_from,
                std::span<const std::uint32_t> faces_to);

  std::vector<std::uint32_t> order_;  ///< the vertices, block by block
  std::vector<Vector3d> ordered_m_;   ///< and where they are
  std::vector<Block> blocks_;
};

}  // namespace wrenchd
