// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/search_path.hpp"

#include <utility>

#include "config/config_error.hpp"
#include "config/near_file.hpp"
#include "config/toml_files.hpp"
#include "core/files/absolute_name.hpp"

namespace wrenchd {
namespace fs = std::filesystem;
namespace {

constexpr const char* kProfiles = "profiles";
constexpr const char* kProfileExtension = ".toml";

}  // namespace

SearchPath::SearchPath()
    : SearchPath({"/etc/wrenchd", "/usr/share/wrenchd"
#ifdef WRENCHD_SOURCE_CONFIG_DIR
                  ,
                  WRENCHD_SOURCE_CONFIG_DIR
#endif
      }) {
}

SearchPath::SearchPath(std::vector<fs::path> directories) : directories_(std::move(directories)) {}

std::vector<fs::path> SearchPath::candidates(const fs::path& name, const fs::path& named_in) const {
  if (name.is_absolute()) return {name};
  std::vector<fs::path> places;
  if (!named_in.empty()) places.push_back(named_in.parent_path() / name);
  for (const fs::path& directory : directories_) places.push_back(directory / name);
  return places;
}

std::optional<fs::path> SearchPath::find(const fs::path& name, const fs::path& named_in) const {
  for (const fs::path& place : candidates(name, named_in)) {
    // A file that cannot be accessed counts as present, so opening it reports the error. Skipping it would
    // silently replace the administrator's file by the package's.
    std::error_code ignored;
    if (fs::status(place, ignored).type() != fs::file_type::not_found) return place;
  }
  return {};
}

fs::path SearchPath::require(const fs::path& name) const {
  const auto found = find(name);
  if (!found) throw ConfigError(name, {}, not_found(name));
  return *found;
}

std::string SearchPath::searched(const fs::path& name, const fs::path& named_in) const {
  std::string places;
  for (const fs::path& place : candidates(name, named_in)) {
    places += (places.empty() ? "" : ", ") + absolute_name(place).string();
  }
  return "no such file; searched " + places;
}

std::string SearchPath::advice(const fs::path& name, const fs::path& named_in) const {
  // A profile is named without its directory and extension, as in --profile polhem.
  const bool profile = name.parent_path() == kProfiles && name.extension() == kProfileExtension;
  for (const fs::path& place : candidates(name, named_in)) {
    const fs::path near = near_file(place);
    if (near.empty()) continue;
    return "; did you mean '" + (profile ? near.stem() : near.lexically_normal()).string() + "'?";
  }
  return {};
}

std::string SearchPath::not_found(const fs::path& name, const fs::path& named_in) const {
  return searched(name, named_in) + advice(name, named_in);
}

fs::path profile_file(const std::string& name) {
  return name.ends_with(kProfileExtension) ? fs::path(name)
                                           : fs::path(kProfiles) / (name + kProfileExtension);
}

std::vector<fs::path> profile_files(const SearchPath& search) {
  return toml_files(kProfiles, search);
}

}  // namespace wrenchd
