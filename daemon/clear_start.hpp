// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "collision/scene.hpp"
#include "config/settings.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Returns by how far the path of a simulated hand must be displaced, in the device base B [m], if it starts
/// where the tool overlaps an obstacle; zero if it does not. A hand that stands inside an obstacle never
/// arms, because the first force would push it. The displaced path is clear until the loop is armed. Empty if
/// no such displacement was found. Not RT-safe: may take seconds deep inside a fine mesh.
std::optional<Vector3d> displacement_to_clear_start(const Scene& scene, const Settings& settings);

}  // namespace wrenchd
