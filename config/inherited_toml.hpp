// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "config/search_path.hpp"
#include "config/toml_file.hpp"

namespace wrenchd {

/// Reads a profile, and lays it over the one it names with `inherits = "NAME"`, and that over its own parent:
/// tables are merged key by key, and everything else the nearer file says replaces what the farther one says,
/// arrays as a whole. The key `inherits` itself is gone from the result, and values that came from a parent
/// have its file in their place.
///
/// NAME.toml is looked for beside the file first, then in profiles/ along the search path; a file that is
/// already part of the chain is passed over, so that /etc/wrenchd/profiles/x.toml may inherit the package's
/// x. Throws ConfigError: no such parent, a chain that closes on itself, or what read_toml_file() throws.
/// chain: where given, is filled with the files it was read from, the nearest first.
TomlNode read_inherited(const std::filesystem::path& file, const SearchPath& search,
                        std::vector<std::filesystem::path>* chain = nullptr);

}  // namespace wrenchd
