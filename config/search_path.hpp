// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace wrenchd {

/// Where wrenchd looks for wrenchd.toml, profiles, scenes and hand scripts.
///
///   an absolute name       that file and no other
///   a name inside FILE     beside FILE first, then along the directories below
///   any other name         along the directories below
///
/// The directories: /etc/wrenchd (the administrator's), /usr/share/wrenchd (the package's), then config/ of
/// the source tree wrenchd was built from, unless a package was built (WRENCHD_SEARCH_SOURCE=OFF).
class SearchPath {
 public:
  SearchPath();
  explicit SearchPath(std::vector<std::filesystem::path> directories);

  /// Every place where NAME may be, in order. named_in: the file that holds the name, if one does.
  std::vector<std::filesystem::path> candidates(const std::filesystem::path& name,
                                                const std::filesystem::path& named_in = {}) const;
  /// Those directories, in order.
  const std::vector<std::filesystem::path>& directories() const noexcept { return directories_; }
  /// The first candidate that is there.
  std::optional<std::filesystem::path> find(const std::filesystem::path& name,
                                            const std::filesystem::path& named_in = {}) const;
  /// The same; throws ConfigError that lists every place looked at.
  std::filesystem::path require(const std::filesystem::path& name) const;
  /// "not found; looked for A, B, C"
  std::string not_found(const std::filesystem::path& name, const std::filesystem::path& named_in = {}) const;

 private:
  std::vector<std::filesystem::path> directories_;
};

/// "loopback" is profiles/loopback.toml; a name that ends in .toml is a file as it stands.
std::filesystem::path profile_file(const std::string& name);

/// Every profile there is: profiles/*.toml of all directories. Of two with the same name the one in the
/// earlier directory counts, as for find(). Sorted by name. What cannot be listed is passed over.
std::vector<std::filesystem::path> profile_files(const SearchPath& search);

}  // namespace wrenchd
