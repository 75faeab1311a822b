// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "config/search_path.hpp"

namespace wrenchd {

/// The .toml files of a folder of all directories of the search path. Of two with the same name the one in
/// the earlier directory counts, as for SearchPath::find(). Sorted by name. What cannot be listed is passed
/// over.
std::vector<std::filesystem::path> toml_files(const std::filesystem::path& folder, const SearchPath& search);

}  // namespace wrenchd
