// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

namespace wrenchd::test {

/// Mesh formats that fuzz_mesh selects by the first byte modulo 8: 0 to 3 as a solid, 4 to 7 as a surface.
inline constexpr std::array<const char*, 4> kMeshFormats = {".off", ".obj", ".stl", ".ply"};

}  // namespace wrenchd::test
