// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace wrenchd {

/// The files that the server delivers to browsers: the page and its libraries, loaded into memory at the
/// start. No other file is accessible. Not RT-safe: reads files.
class PageFiles {
 public:
  struct File {
    std::string type;  ///< MIME type, such as "text/html; charset=utf-8"
    std::string bytes;
  };

  /// Loads all files below the directory. Throws std::runtime_error if it contains no index.html.
  explicit PageFiles(const std::filesystem::path& directory);

  /// Returns the file with this URL path, such as "main.js"; "" is the page itself. Null if there is none.
  const File* find(std::string_view name) const;
  /// Returns the content security policy: the page may load and run only delivered files and its inline
  /// import map.
  const std::string& security_policy() const noexcept { return policy_; }

  /// Returns share/wrenchd/view next to the program's directory, or the installed directory. Throws
  /// std::runtime_error with the searched directories if neither exists.
  static std::filesystem::path directory();

 private:
  std::map<std::string, File, std::less<>> files_;
  std::string policy_;
};

}  // namespace wrenchd
