// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// Reads a scene; config/scenes/cube_on_table.toml shows the format. The mesh path comes back as one that can
/// be opened from here, and normals as unit vectors; a scene without obstacles is free space. Throws
/// ConfigError.
SceneSettings load_scene(const std::filesystem::path& file);

}  // namespace wrenchd
