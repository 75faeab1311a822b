// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "config/search_path.hpp"

namespace wrenchd {

/// The .toml files of `folder` in all directories of the search path, sorted by name. Of two with the same
/// name the earlier directory counts, as in SearchPath::find(). Unreadable directories are skipped. Not
/// RT-safe: reads directories.
std::vector<std::filesystem::path> toml_files(const std::filesystem::path& folder, const SearchPath& search);

}  // namespace wrenchd
