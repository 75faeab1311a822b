// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "collision/meshes/mesh_loader.hpp"
#include "tools/descriptor_source.hpp"

namespace wrenchd {

/// Reads a TOML file of any of our kinds, and the files it names, as the daemon would. Returns what it found,
/// in a few lines for a person, with what was repaired in meshes and what is unlikely about them; throws what
/// the loaders throw where something is wrong. The kind is told by the keys: [tool] makes a scene,
/// [pose_report], transport or inherits a profile, [[waypoint]] a hand script, anything else a
/// configuration.
std::string check_file(const std::filesystem::path& file, MeshLoader& meshes);

/// Reads a device profile and holds it against what a device says of its reports. Returns a line that they
/// agree; throws std::runtime_error with a line for each thing they disagree about, and what the loader and
/// the parser throw.
std::string check_against_descriptor(const std::filesystem::path& profile, const DescriptorSource& device);

}  // namespace wrenchd
