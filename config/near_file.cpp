// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/near_file.hpp"

#include <string>
#include <vector>

#include "config/nearest_key.hpp"

namespace wrenchd {
namespace fs = std::filesystem;
namespace {

/// Entries of a directory that are compared; in a larger directory a suggestion is not worth the time.
constexpr std::size_t kMaxEntries = 5000;

std::vector<std::string> names_in(const fs::path& directory, bool directories) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(directory.empty() ? "." : directory, error), end;
       !error && entry != end && names.size() < kMaxEntries; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_directory(ignored) == directories) names.push_back(entry->path().filename().string());
  }
  return names;
}

/// Returns the directory, or the near one that exists; nothing if there is none.
bool find_directory(const fs::path& typed, fs::path& found) {
  std::error_code ignored;
  if (typed.empty() || fs::is_directory(typed, ignored)) {
    found = typed;
    return true;
  }
  fs::path parent;
  if (!typed.has_filename() || typed.parent_path() == typed || !find_directory(typed.parent_path(), parent))
    return false;
  const std::string near = nearest_name(typed.filename().string(), names_in(parent, true));
  found = parent / near;
  return !near.empty();
}

}  // namespace

fs::path near_file(const fs::path& missing) {
  fs::path directory;
  if (!missing.has_filename() || !find_directory(missing.parent_path(), directory)) return {};
  const std::string typed = missing.filename().string();
  const std::vector<std::string> names = names_in(directory, false);
  for (const std::string& name :
       names)  // the directory was mistyped, or the extension is another one or missing
    if (name == typed) return directory / name;
  for (const std::string& name : names)
    if (fs::path(name).stem() == missing.stem()) return directory / name;
  const std::string near = nearest_name(typed, names);
  return near.empty() ? fs::path() : directory / near;
}

}  // namespace wrenchd
