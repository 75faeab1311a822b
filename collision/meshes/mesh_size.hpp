// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Largest sides that a body of some use is likely to have [m].
struct PlausibleSize {
  double min_m, max_m;
};
/// What a hand can hold, and what it can reach.
constexpr PlausibleSize kPlausibleToolSize = {1e-3, 2.0};
constexpr PlausibleSize kPlausibleObstacleSize = {1e-3, 100.0};

/// Neither STL nor OBJ knows its unit. What to ask where a mesh in file units has an unlikely size at this
/// scale [metres per mesh unit]; nothing where it is likely.
std::optional<std::string> implausible_size(const TriangleMesh& mesh, double scale, PlausibleSize likely);

/// Contacts between meshes are kept apart by a nanometre, in double precision. Throws MeshError where a body
/// is too small for that to be little, or so large or far from its own origin that it is rounded away.
void require_size_for_contacts(const TriangleMesh& mesh, double scale, const std::filesystem::path& file);

}  // namespace wrenchd
