// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// Reads a scene; config/scenes/cube_on_table.toml shows the format. A mesh path comes back as one that can
/// be opened from here, and normals as unit vectors; a scene without obstacles is free space. Throws
/// ConfigError.
SceneSettings load_scene(const std::filesystem::path& file);
/// The same of what was read from that file already.
SceneSettings load_scene(const TomlNode& tree, const std::filesystem::path& file);

/// Adds an obstacle, given as the table that an [[obstacle]] of a scene file is; its mesh is looked for
/// beside the scene. source: for messages. Throws ConfigError, also where its name is another's.
void add_obstacle(const TomlNode& obstacle, const std::filesystem::path& source, SceneSettings& scene);

}  // namespace wrenchd
