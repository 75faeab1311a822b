// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "collision/bodies/free_body.hpp"
#include "collision/scene.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Returns the bodies at admissible poses: each at the pose nearest to the given one at which it overlaps
/// neither the obstacles of the scene at scene time 0 nor a body before it. The loader collects a text for
/// each body that moves by more than kPlacement_m. Throws MeshError if a body has no such pose. Not RT-safe:
/// may take seconds.
std::vector<FreeBody> placed(std::vector<FreeBody> bodies, const Scene& obstacles, MeshLoader& loader);
inline constexpr double kPlacement_m = 1e-6;

/// Returns the scene with its bodies as obstacles at rest, after the other obstacles, at the given poses of
/// their body frames. Not RT-safe: allocates.
Scene with_bodies_as_obstacles(const Scene& scene, std::span<const Pose> X_WB);
/// Returns the scene with its bodies as obstacles at their start. Not RT-safe: allocates.
Scene with_bodies_as_obstacles(const Scene& scene);

}  // namespace wrenchd
