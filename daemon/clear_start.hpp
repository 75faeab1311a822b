// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "collision/scene.hpp"
#include "config/settings.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Returns by how far the path of a simulated hand must be displaced, in the device base B [m], so that the
/// tool overlaps no obstacle where the path starts: zero if it overlaps none. A hand that starts inside an
/// obstacle never arms, because the first force would push it. X_BH: the start of the path. Empty if no
/// admissible pose was found. Not RT-safe: may take seconds deep inside a fine mesh.
std::optional<Vector3d> displacement_to_clear_start(const Scene& scene, const Settings& settings,
                                                    const Pose& X_BH);

}  // namespace wrenchd
