// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/scene_settings.hpp"

namespace wrenchd {

/// Largest number of triangles that one change over the control socket may add. A million triangles take
/// about 1 GB while they are prepared, and seconds. Larger scenes come from the configuration.
inline constexpr std::uint64_t kMaxAddedTriangles = 2'000'000;

/// Throws std::invalid_argument if the meshes of `scene` that `present` does not have are too expensive for a
/// change over the control socket. The number of triangles of a file is estimated from its size, before it is
/// read. Not RT-safe: reads file sizes.
void check_scene_cost(const SceneSettings& scene, const SceneSettings& present);

}  // namespace wrenchd
