// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

namespace wrenchd::test {

/// The first byte of an input of fuzz_mesh, modulo 8: format, and 4 more for a surface.
inline constexpr std::array<const char*, 4> kMeshFormats = {".off", ".obj", ".stl", ".ply"};

}  // namespace wrenchd::test
