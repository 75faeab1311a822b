// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// A cache on disk for results that take long to compute. Each content has one file. The key is a hash of the
/// inputs and of the source files that compute the result. So a cached result equals a fresh one.
///
/// A file that is truncated, modified, owned by another user or malformed counts as missing. If the directory
/// is not writable, write() fails and the caller warns. The cache deletes its oldest files when its total
/// size exceeds 2 GiB. Any number of processes may share a directory. Not RT-safe: reads and writes files.
class MeshCache {
 public:
  /// directory: created by the first write(). Empty: the cache is disabled.
  explicit MeshCache(std::filesystem::path directory) : directory_(std::move(directory)) {}

  bool disabled() const noexcept { return directory_.empty(); }

  /// Returns the key for ordered inputs.
  static std::string key(const std::vector<std::string_view>& made_from);

  /// Returns the cached bytes, or nothing if the file is missing or invalid.
  std::optional<std::string> read(const std::string& key) const;

  /// Returns false if the bytes cannot be written; error() then states the reason.
  bool write(const std::string& key, std::string_view bytes);
  const std::string& error() const noexcept { return error_; }

 private:
  std::filesystem::path path_of(const std::string& key) const;
  bool fail(const std::string& why);
  void evict_oldest() const;

  std::filesystem::path directory_;
  std::string error_;
};

/// Returns the SHA-256 of these bytes, in hexadecimal. Not RT-safe: allocates.
std::string sha256_text(std::string_view bytes);

/// Returns the cache directory: $CACHE_DIRECTORY (set by systemd for a service, /var/cache/wrenchd),
/// otherwise $XDG_CACHE_HOME/wrenchd, otherwise ~/.cache/wrenchd. Empty if none of these is set. Not RT-safe:
/// allocates.
std::filesystem::path cache_directory();

}  // namespace wrenchd
