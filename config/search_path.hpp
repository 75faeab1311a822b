// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace wrenchd {

/// Search path of wrenchd.toml, profiles, scenes and hand scripts.
///
///   an absolute name       only that file
///   a name inside FILE     beside FILE, then along the directories below
///   any other name         along the directories below
///
/// Directories: /etc/wrenchd (administrator), /usr/share/wrenchd (package), then config/ of the source tree
/// of the build, unless WRENCHD_SEARCH_SOURCE=OFF. Not RT-safe: accesses files.
class SearchPath {
 public:
  SearchPath();
  explicit SearchPath(std::vector<std::filesystem::path> directories);

  /// All candidate files for NAME, in order. named_in: the file that contains the name, if any.
  std::vector<std::filesystem::path> candidates(const std::filesystem::path& name,
                                                const std::filesystem::path& named_in = {}) const;
  /// The directories in order.
  const std::vector<std::filesystem::path>& directories() const noexcept { return directories_; }
  /// The first existing candidate.
  std::optional<std::filesystem::path> find(const std::filesystem::path& name,
                                            const std::filesystem::path& named_in = {}) const;
  /// The first existing candidate; throws ConfigError with all candidates if none exists.
  std::filesystem::path require(const std::filesystem::path& name) const;
  /// The message "no such file; searched A, B, C".
  std::string searched(const std::filesystem::path& name, const std::filesystem::path& named_in = {}) const;
  /// Returns "; did you mean 'D'?" if a file of a similar name exists, else "". It shows the name of a file,
  /// so it is for users who may list the directories.
  std::string advice(const std::filesystem::path& name, const std::filesystem::path& named_in = {}) const;
  /// searched() and advice().
  std::string not_found(const std::filesystem::path& name, const std::filesystem::path& named_in = {}) const;

 private:
  std::vector<std::filesystem::path> directories_;
};

/// profiles/loopback.toml for "loopback"; a name that ends in .toml is returned unchanged.
std::filesystem::path profile_file(const std::string& name);

/// All profiles: profiles/*.toml of all directories, sorted by name. Of two with the same name the earlier
/// directory counts, as in find(). Unreadable directories are skipped.
std::vector<std::filesystem::path> profile_files(const SearchPath& search);

}  // namespace wrenchd
