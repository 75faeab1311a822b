// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// Vertices and triangles, counter-clockwise seen from outside. Lengths in metres once loaded.
struct TriangleMesh {
  std::vector<Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

}  // namespace wrenchd
