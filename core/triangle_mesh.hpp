// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// What a mesh is the skin of: a solid, which has an inside, or nothing. A surface has two sides, and
/// whatever starts on one of them is kept there.
enum class BodyKind : std::uint8_t { solid, surface };

/// Vertices and triangles, counter-clockwise seen from outside. Lengths in metres once loaded.
struct TriangleMesh {
  std::vector<Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

}  // namespace wrenchd
