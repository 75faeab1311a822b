// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// A local HTML file that redirects a browser to an address. Only its owner can read the file, so the address
/// does not appear on a command line, which every user can read. The destructor removes the file. Not
/// RT-safe: writes a file.
class RedirectPage {
 public:
  /// Writes the file in XDG_RUNTIME_DIR, or in a new directory of its own if that is not a directory of this
  /// user. url: without characters that HTML reserves. Throws std::system_error.
  explicit RedirectPage(const std::string& url);
  ~RedirectPage();
  RedirectPage(const RedirectPage&) = delete;
  RedirectPage& operator=(const RedirectPage&) = delete;

  const std::filesystem::path& file() const noexcept { return file_; }

 private:
  std::filesystem::path own_directory_;  ///< empty if the file is in XDG_RUNTIME_DIR
  std::filesystem::path file_;
};

}  // namespace wrenchd
