// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// A file with a page that leads a browser to an address. Only the owner can read it. So the address, which
/// contains a token, is on no command line: every user of the machine can read command lines. The file is in
/// $XDG_RUNTIME_DIR, or in a private temporary directory. The destructor removes it. Not RT-safe: writes a
/// file.
class AddressFile {
 public:
  /// url: http address without characters that HTML quotes. Throws std::system_error.
  explicit AddressFile(const std::string& url);
  ~AddressFile() { remove(); }
  AddressFile(const AddressFile&) = delete;
  AddressFile& operator=(const AddressFile&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }
  /// Removes the file now: the browser has followed it.
  void remove() noexcept;

 private:
  std::filesystem::path directory_;  ///< created by this object
  std::filesystem::path path_;
};

}  // namespace wrenchd
