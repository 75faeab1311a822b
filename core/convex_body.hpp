// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// A convex polyhedron: vertices in the body frame T, and for each vertex its neighbours in order around it
/// (the sequence N_v of section 3.3). Built once, then only read.
struct ConvexBody {
  std::vector<Vector3d> vertices_T_m;
  std::vector<std::uint32_t>
      ring_begin;  ///< ring of vertex i: ring[ring_begin[i]] up to ring[ring_begin[i + 1]]
  std::vector<std::uint32_t> ring;

  std::span<const std::uint32_t> ring_of(std::size_t vertex) const noexcept {
    return std::span(ring).subspan(ring_begin[vertex], ring_begin[vertex + 1] - ring_begin[vertex]);
  }
};

}  // namespace wrenchd
