// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "config/settings.hpp"
#include "config/toml_file.hpp"

namespace wrenchd {

/// Reads wrenchd.toml; config/wrenchd.toml is the manual of the format. Finds the files it names (scene,
/// profile, hand script) and reads the hand script. Throws ConfigError.
Settings load_settings(const std::filesystem::path& file, const SearchPath& search);
/// The same of what was read from that file already.
Settings load_settings(const TomlNode& tree, const std::filesystem::path& file, const SearchPath& search);

/// Changes what [rendering] and [wrench] say, given as a table that holds those tables, or parts of them;
/// what is not in it stays. source: for messages. Throws ConfigError; then nothing is changed.
void change_rendering(const TomlNode& changes, const std::filesystem::path& source, Settings& settings);

}  // namespace wrenchd
