// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/search_path.hpp"
#include "config/toml_file.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// All valid profiles along a search path.
struct KnownProfiles {
  std::vector<DeviceProfile> profiles;       ///< in the order of their file names
  std::vector<std::filesystem::path> files;  ///< file of each profile
  std::vector<std::string> rejected;         ///< for each rejected file its defects with location and remedy
  std::vector<std::vector<ConfigText>> texts;  ///< files of each profile as they were read, the nearest first
};

/// Loads all profiles. A rejected profile does not affect the others. Not RT-safe: reads files.
KnownProfiles known_profiles(const SearchPath& search);

}  // namespace wrenchd
