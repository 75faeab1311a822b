// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/search_path.hpp"

namespace wrenchd {

/// A scene of the gallery: a whole configuration that says what there is to feel and to see.
struct GalleryScene {
  std::string name;
  std::filesystem::path file;
  std::string description;
};

/// Those in gallery/ along the search path, by name. Throws ConfigError where one of them cannot be read.
std::vector<GalleryScene> gallery(const SearchPath& search);

/// A line for each: its name, and the first sentence of what it says.
std::string gallery_text(const SearchPath& search);

/// One of them: what there is to feel and to see, and the command that runs it. Throws std::runtime_error,
/// with those there are, where there is none of that name.
std::string gallery_text(const SearchPath& search, const std::string& name);

}  // namespace wrenchd
