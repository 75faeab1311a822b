// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Reads a device profile, and those it inherits along the search path; config/profiles/example.toml is the
/// manual of the format. Throws ConfigError.
DeviceProfile load_profile(const std::filesystem::path& file, const SearchPath& search = SearchPath());

/// The profile that a person names on a command line: a file where there is one of that name, from here, and
/// otherwise the one of that name along the search path. Throws as load_profile().
DeviceProfile load_profile_named(const std::string& name, const SearchPath& search = SearchPath());

}  // namespace wrenchd
