// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace wrenchd {

/// What the browser is served: the page and its libraries, read into memory at the start. Nothing else of the
/// machine can be asked for.
class PageFiles {
 public:
  struct File {
    std::string type;  ///< "text/html; charset=utf-8"
    std::string bytes;
  };

  /// Everything below that directory. Throws std::runtime_error where there is no index.html.
  explicit PageFiles(const std::filesystem::path& directory);

  /// name: as in a URL, "main.js", "" for the page itself. Null: there is none.
  const File* find(std::string_view name) const;
  /// What the page may load and run: only what is served here, and the one script that stands in it.
  const std::string& security_policy() const noexcept { return policy_; }

  /// share/wrenchd/view beside the directory of this program, or where the package has it. Throws
  /// std::runtime_error that names the places.
  static std::filesystem::path directory();

 private:
  std::map<std::string, File, std::less<>> files_;
  std::string policy_;
};

}  // namespace wrenchd
