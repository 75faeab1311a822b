// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "config/toml_file.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Reads a device profile and the profiles that it inherits along the search path; manual:
/// config/profiles/example.toml. texts: if given, receives the files as they were read, the nearest first.
/// Throws ConfigError. Not RT-safe: reads files.
DeviceProfile load_profile(const std::filesystem::path& file, const SearchPath& search = SearchPath(),
                           std::vector<ConfigText>* texts = nullptr);

/// Loads the profile that a user names on a command line: the file of this name if there is one, otherwise
/// the profile of this name along the search path. Throws as load_profile(). Not RT-safe: reads files.
DeviceProfile load_profile_named(const std::string& name, const SearchPath& search = SearchPath());

}  // namespace wrenchd
