// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/toml_files.hpp"

#include <map>

namespace wrenchd {
namespace fs = std::filesystem;

std::vector<fs::path> toml_files(const fs::path& folder, const SearchPath& search) {
  std::map<fs::path, fs::path> by_name;
  for (const fs::path& directory : search.directories()) {
    std::error_code error;
    for (fs::directory_iterator entry(directory / folder, error), end; !error && entry != end;
         entry.increment(error)) {
      if (entry->path().extension() == ".toml") by_name.emplace(entry->path().filename(), entry->path());
    }
  }
  std::vector<fs::path> files;
  files.reserve(by_name.size());
  for (const auto& [name, file] : by_name) files.push_back(file);
  return files;
}

}  // namespace wrenchd
