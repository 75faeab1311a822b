// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A closed triangle mesh with half-edges, whose edges can be collapsed. Half-edge 3 t + i of triangle t goes
/// from corner i to corner i + 1. Not RT-safe: allocates.
class HalfEdgeMesh {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  static constexpr std::uint32_t next(std::uint32_t half_edge) {
    return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1;
  }
  static constexpr std::uint32_t previous(std::uint32_t half_edge) {
    return half_edge % 3 == 0 ? half_edge + 2 : half_edge - 1;
  }
  static constexpr std::uint32_t face_of(std::uint32_t half_edge) { return half_edge / 3; }

  explicit HalfEdgeMesh(TriangleMesh mesh)
      : vertices_m_(std::move(mesh.vertices_m)), triangles_(std::move(mesh.triangles)) {
    is_manifold_ = pair_half_edges() && find_outgoing();
  }

  /// True if every edge joins two faces and the faces at every vertex form one fan. If false, only
  /// vertex_m(), corners() and the counts may be used.
  bool is_manifold() const { return is_manifold_; }
  std::uint32_t half_edge_count() const { return static_cast<std::uint32_t>(3 * triangles_.size()); }
  bool removed(std::uint32_t face) const { return triangles_[face][0] == kNone; }
  bool removed_vertex(std::uint32_t vertex) const { return outgoing_[vertex] == kNone; }
  std::uint32_t from(std::uint32_t half_edge) const { return triangles_[half_edge / 3][half_edge % 3]; }
  std::uint32_t to(std::uint32_t half_edge) const { return from(next(half_edge)); }
  std::uint32_t twin(std::uint32_t half_edge) const { return twin_[half_edge]; }
  std::uint32_t valence(std::uint32_t vertex) const { return valence_[vertex]; }
  const Vector3d& vertex_m(std::uint32_t vertex) const { return vertices_m_[vertex]; }
  void move_vertex(std::uint32_t vertex, const Vector3d& p_m) { vertices_m_[vertex] = p_m; }
  const std::array<std::uint32_t, 3>& corners(std::uint32_t face) const { return triangles_[face]; }
  std::size_t face_count() const { return triangles_.size(); }
  std::size_t vertex_count() const { return vertices_m_.size(); }

  /// Calls use(half-edge) for each half-edge that leaves the start of `first`: begins with `first`, and goes
  /// on anticlockwise as seen from outside.
  template <class Use>
  void for_each_outgoing_from(std::uint32_t first, const Use& use) const {
    std::uint32_t h = first;
    do {
      use(h);
      h = twin_[previous(h)];
    } while (h != first);
  }
  template <class Use>
  void for_each_outgoing(std::uint32_t vertex, const Use& use) const {
    for_each_outgoing_from(outgoing_[vertex], use);
  }

  /// Merges the end of the half-edge into its start and moves the start to p_m. Precondition: the collapse
  /// keeps the mesh a manifold.
  void collapse(std::uint32_t half_edge, const Vector3d& p_m) {
    const std::uint32_t kept = from(half_edge), gone = to(half_edge), opposite = twin_[half_edge];
    for_each_outgoing(gone, [&](std::uint32_t h) { triangles_[h / 3][h % 3] = kept; });
    valence_[kept] += valence_[gone] - 4;
    for (const std::uint32_t h : {half_edge, opposite}) {
      --valence_[from(previous(h))];
      const std::uint32_t a = twin_[next(h)], b = twin_[previous(h)];
      twin_[a] = b;
      twin_[b] = a;
      outgoing_[from(b)] = b;
      outgoing_[from(a)] = a;
    }
    for (const std::uint32_t h : {half_edge, opposite}) triangles_[face_of(h)].fill(kNone);
    outgoing_[gone] = kNone;
    vertices_m_[kept] = p_m;
  }

 private:
  /// Returns false unless every edge has exactly one half-edge in each direction.
  bool pair_half_edges() {
    // Groups the half-edges by the smaller number of their ends. Sorting each small group then brings the two
    // directions of an edge together.
    std::vector<std::uint32_t> begin(vertices_m_.size() + 1, 0), at_vertex(half_edge_count());
    const auto smaller_end = [&](std::uint32_t h) { return std::min(from(h), to(h)); };
    for (std::uint32_t h = 0; h < half_edge_count(); ++h) ++begin[smaller_end(h) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<std::uint32_t> end(begin.begin(), begin.end() - 1);
    for (std::uint32_t h = 0; h < half_edge_count(); ++h) at_vertex[end[smaller_end(h)]++] = h;
    twin_.assign(half_edge_count(), kNone);
    for (std::uint32_t v = 0; v < vertices_m_.size(); ++v) {
      const auto first = at_vertex.begin() + begin[v], last = at_vertex.begin() + begin[v + 1];
      const auto larger_end = [&](std::uint32_t h) { return std::max(from(h), to(h)); };
      std::sort(first, last, [&](std::uint32_t g, std::uint32_t h) {
        return std::pair(larger_end(g), g) < std::pair(larger_end(h), h);
      });
      if ((last - first) % 2 != 0) return false;
      for (auto at = first; at != last; at += 2) {
        const std::uint32_t g = at[0], h = at[1];
        if (larger_end(g) != larger_end(h) || from(g) == from(h)) return false;
        if (last - at > 2 && larger_end(at[2]) == larger_end(g)) return false;
        twin_[g] = h;
        twin_[h] = g;
      }
    }
    return true;
  }

  /// Returns false unless the faces at every vertex form one fan.
  bool find_outgoing() {
    outgoing_.assign(vertices_m_.size(), kNone);
    valence_.assign(vertices_m_.size(), 0);
    for (std::uint32_t h = 0; h < half_edge_count(); ++h) {
      outgoing_[from(h)] = h;
      ++valence_[from(h)];
    }
    for (std::uint32_t v = 0; v < vertices_m_.size(); ++v) {
      if (outgoing_[v] == kNone) continue;
      std::uint32_t in_fan = 0;
      for_each_outgoing(v, [&](std::uint32_t) { ++in_fan; });
      if (in_fan != valence_[v]) return false;
    }
    return true;
  }

  std::vector<Vector3d> vertices_m_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::uint32_t> twin_;
  std::vector<std::uint32_t> outgoing_;
  std::vector<std::uint32_t> valence_;  ///< number of faces at each vertex
  bool is_manifold_ = false;
};

}  // namespace wrenchd
