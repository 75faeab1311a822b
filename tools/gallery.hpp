// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/search_path.hpp"

namespace wrenchd {

/// A scene of the gallery: a complete configuration with a description of the expected forces.
struct GalleryScene {
  std::string name;
  std::filesystem::path file;
  std::string description;
};

/// Returns the scenes in the gallery/ directories of the search path, sorted by name. Throws ConfigError if a
/// scene cannot be read. Not RT-safe: reads files.
std::vector<GalleryScene> gallery(const SearchPath& search);

/// Returns one line per scene: its name and the first sentence of its description. Throws ConfigError if a
/// scene cannot be read. Not RT-safe: reads files.
std::string gallery_text(const SearchPath& search);

/// Returns the description of one scene and the command that runs it. Throws std::runtime_error with all
/// names if the name is unknown. Not RT-safe: reads files.
std::string gallery_text(const SearchPath& search, const std::string& name);

}  // namespace wrenchd
