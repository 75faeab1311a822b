// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "collision/meshes/mesh_loader.hpp"
#include "tools/descriptor_source.hpp"

namespace wrenchd {

/// Loads a TOML file and the files that it refers to, as the daemon does. Returns a summary for the user in a
/// few lines, with mesh repairs and implausible properties. The keys determine the type: [tool] makes a
/// scene, [pose_report], transport or inherits a profile, [[waypoint]] a hand script, anything else a
/// configuration. Throws the loaders' exceptions. Not RT-safe: reads files; large meshes take seconds.
std::string check_file(const std::filesystem::path& file, MeshLoader& meshes);

/// Compares a device profile with the report descriptor of a device. Returns a line that confirms the
/// agreement. Throws std::runtime_error with one line per difference, and the exceptions of loader and
/// parser. Not RT-safe: reads files.
std::string check_against_descriptor(const std::filesystem::path& profile, const DescriptorSource& device);

}  // namespace wrenchd
