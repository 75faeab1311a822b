// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "config/second_hand.hpp"
#include "config/settings.hpp"
#include "config/toml_file.hpp"

namespace wrenchd {

/// Reads wrenchd.toml; manual: config/wrenchd.toml. Resolves the files it names (scene, profile, hand script)
/// and reads the hand script. second: if given, receives the second hand, or nothing if the file has no
/// [[hand]]. Throws ConfigError. Not RT-safe: reads files.
Settings load_settings(const std::filesystem::path& file, const SearchPath& search,
                       std::optional<SecondHand>* second = nullptr);
/// Converts settings that were read from `file` before.
Settings load_settings(const TomlNode& tree, const std::filesystem::path& file, const SearchPath& search,
                       std::optional<SecondHand>* second = nullptr);

/// Applies a table with [rendering] and [wrench], or parts of them; other settings remain. source: for
/// messages. Throws ConfigError and then changes nothing. Not RT-safe: allocates.
void change_rendering(const TomlNode& changes, const std::filesystem::path& source, Settings& settings);

}  // namespace wrenchd
