// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/import/output_set.hpp"
#include "tools/import/robot_import.hpp"

namespace wrenchd {

/// Adds a scene and its meshes to the outputs: each body becomes an obstacle with a mesh file beside the
/// scene, named after both. The tool is a sphere, as a placeholder. The scene's surface_tolerance_m is the
/// largest chord error, from 1 um to 1 mm. source: for comments. Returns the names of the mesh files. Not
/// RT-safe: writes files.
std::vector<std::string> add_scene(const std::filesystem::path& scene, const std::vector<PlacedBody>& bodies,
                                   const std::string& source, OutputSet& outputs);

}  // namespace wrenchd
