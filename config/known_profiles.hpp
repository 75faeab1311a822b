// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/search_path.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Every profile along a search path, as far as it is good.
struct KnownProfiles {
  std::vector<DeviceProfile> profiles;       ///< by the names of their files
  std::vector<std::filesystem::path> files;  ///< of each of them
  std::vector<std::string> refused;          ///< what is wrong with each of the other files: place and cure
};

/// Loads them all. One that is refused is told and hides none of the others. Not RT safe.
KnownProfiles known_profiles(const SearchPath& search);

}  // namespace wrenchd
