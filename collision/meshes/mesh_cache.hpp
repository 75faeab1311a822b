// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// Keeps on disk what takes long to make, a file for each content. The key is a hash of all that it was made
/// from, and of the sources of the code that made it: what is found under a key is what would be made again.
///
/// A file that is cut short, changed, of somebody else's or no cache file at all counts as none. A directory
/// that cannot be written to is no error, only a remark. The oldest files go when all together take more than
/// 2 GiB. Any number of processes may share a directory. Not RT safe.
class MeshCache {
 public:
  /// A directory; it is made when it is first written to. Empty: nothing is kept.
  explicit MeshCache(std::filesystem::path directory) : directory_(std::move(directory)) {}

  bool disabled() const noexcept { return directory_.empty(); }

  /// From what something is made, in this order, to its key.
  static std::string key(const std::vector<std::string_view>& made_from);

  /// The bytes kept under a key, if there are any, and good.
  std::optional<std::string> read(const std::string& key) const;

  /// False where it cannot be written; why() says it then.
  bool write(const std::string& key, std::string_view bytes);
  const std::string& error() const noexcept { return error_; }

 private:
  std::filesystem::path path_of(const std::string& key) const;
  bool fail(const std::string& why);
  void evict_oldest() const;

  std::filesystem::path directory_;
  std::string error_;
};

/// Where caches belong: $CACHE_DIRECTORY, which systemd gives a service (/var/cache/wrenchd), else
/// $XDG_CACHE_HOME/wrenchd, else ~/.cache/wrenchd. Empty where there is none of these.
std::filesystem::path cache_directory();

}  // namespace wrenchd
