// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "collision/scene.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Returns the distance of two triangles that do not intersect [m]: the least of the distances of their
/// vertices from the other triangle and of their edges from each other. a, b: corners in one frame. RT-safe.
double triangle_distance_m(const std::array<Vector3d, 3>& a, const std::array<Vector3d, 3>& b) noexcept;

/// Returns the distance of two surfaces that do not intersect [m], found by best-first descent of their BVHs.
/// X_BA: pose of A in the frame of B. upper_bound_m: larger distances need not be found; they return
/// upper_bound_m. Not RT-safe: allocates.
double surface_distance_m(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA, double upper_bound_m);

/// Returns the distance of the tool from the nearest obstacle [m], infinity without obstacles. X_WT: pose of
/// the body frame. Precondition: the tool overlaps no obstacle (overlap_test.hpp). The distance is that of
/// the surfaces that contacts use (MeshBvh::surface_tolerance_m). Not RT-safe: allocates, may take
/// milliseconds.
double clearance_m(const Scene& scene, const Pose& X_WT, double scene_time_s);

}  // namespace wrenchd
