// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// Kind of body that a mesh bounds. A solid has an inside. A surface has two sides; a tool stays on the side
/// on which it starts.
enum class BodyKind : std::uint8_t { solid, surface };

/// Vertices and triangles, counter-clockwise seen from outside. Lengths are in metres after loading.
struct TriangleMesh {
  std::vector<Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

}  // namespace wrenchd
