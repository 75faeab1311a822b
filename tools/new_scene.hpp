// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "collision/meshes/mesh_loader.hpp"

namespace wrenchd {

/// What `wrenchctl new` makes a scene from.
struct NewScene {
  std::filesystem::path directory;      ///< is created; must not exist, or be empty
  std::filesystem::path tool;           ///< mesh file
  std::filesystem::path obstacle = {};  ///< mesh file; empty: a table
  std::optional<double> scale = {};     ///< metres per mesh unit; empty: by the size of the tool
};

/// Makes a directory with scene.toml, wrenchd.toml and hand.toml: the simulated hand starts 40 mm above the
/// obstacle, where it can arm, lowers the tool onto it, presses and slides. Returns what it made and how to
/// run it, for a person. Throws MeshError and std::runtime_error that say what to do; then nothing is left
/// behind. Not RT-safe: reads and writes files, may take seconds.
std::string make_new_scene(const NewScene& request, MeshLoader& loader);

}  // namespace wrenchd
