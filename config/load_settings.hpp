// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "config/settings.hpp"

namespace wrenchd {

/// Reads wrenchd.toml; config/wrenchd.toml is the manual of the format. Finds the files it names (scene,
/// profile, hand script) and reads the hand script. Throws ConfigError.
Settings load_settings(const std::filesystem::path& file, const SearchPath& search);

}  // namespace wrenchd
