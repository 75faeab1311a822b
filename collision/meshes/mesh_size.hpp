// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Range of the largest side that a body plausibly has [m].
struct PlausibleSize {
  double min_m, max_m;
};
/// A tool fits into a hand's workspace; an obstacle fits into a room.
constexpr PlausibleSize kPlausibleToolSize = {1e-3, 2.0};
constexpr PlausibleSize kPlausibleObstacleSize = {1e-3, 100.0};

/// Returns a question about the unit if the size of a mesh is implausible, otherwise nothing. STL and OBJ
/// files do not state their unit. scale: metres per mesh unit. Not RT-safe: allocates.
std::optional<std::string> implausible_size(const TriangleMesh& mesh, double scale, PlausibleSize likely);

/// Throws MeshError if a body is outside the range in which contacts can be computed. Contacts between meshes
/// keep a clearance of 1 nm in double precision. The body must be much larger than that, and its coordinates
/// must resolve it. Not RT-safe: allocates.
void require_size_for_contacts(const TriangleMesh& mesh, double scale, const std::filesystem::path& file);

}  // namespace wrenchd
