// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "config/toml_file.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Longest name of a profile.
inline constexpr std::size_t kMaxProfileName_bytes = 100;

/// Returns true if the name has only letters, digits, '-', '_' and dots, and is not longer than
/// kMaxProfileName_bytes. RT-safe.
bool is_profile_name(std::string_view name) noexcept;

/// Reads a device profile and the profiles that it inherits along the search path; manual:
/// config/profiles/example.toml. texts: receives the texts of the files, if given. scope: the files that may
/// be read. Throws ConfigError. Not RT-safe: reads files.
DeviceProfile load_profile(const std::filesystem::path& file, const SearchPath& search = SearchPath(),
                           LoadedTexts* texts = nullptr, const FileScope& scope = {});

/// Loads the profile that a user names on a command line: the file of this name if there is one, otherwise
/// the profile of this name along the search path. Throws as load_profile(). Not RT-safe: reads files.
DeviceProfile load_profile_named(const std::string& name, const SearchPath& search = SearchPath());

}  // namespace wrenchd
