// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "config/toml_reader.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// Reads a scene; format: config/scenes/cube_on_table.toml. Mesh paths are returned relative to the current
/// directory or absolute, normals as unit vectors. A scene without obstacles is free space. Throws
/// ConfigError. scope: where the scene and its meshes may be. Not RT-safe: reads a file.
SceneSettings load_scene(const std::filesystem::path& file, const FileScope& scope = {});
/// Converts a scene that was read from `file` before.
SceneSettings load_scene(const TomlNode& tree, const std::filesystem::path& file,
                         const FileScope& scope = {});

/// Reads a tool, given as the [tool] of a scene file. file: the file that has the table; a relative mesh
/// starts at its directory. Not RT-safe: accesses files.
void read_tool(TomlTable& table, const std::filesystem::path& file, ToolSettings& tool);

/// Adds an obstacle, given as a table like an [[obstacle]] of a scene file; its mesh is searched beside the
/// scene. source: for messages. scope: where its mesh may be. Throws ConfigError, also if its name is in use.
/// Not RT-safe: allocates.
void add_obstacle(const TomlNode& obstacle, const std::filesystem::path& source, SceneSettings& scene,
                  const FileScope& scope = {});

}  // namespace wrenchd
