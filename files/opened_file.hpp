// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "files/owned_fd.hpp"

namespace wrenchd {

/// The files that may be opened on behalf of somebody. Default: any file, through symbolic links.
class FileScope {
 public:
  FileScope() = default;
  /// Only files beneath these directories, without a symbolic link between the directory and the file. The
  /// directories themselves may be links: the administrator names them. An empty list permits no file.
  static FileScope beneath(std::vector<std::filesystem::path> directories);

  bool is_limited() const noexcept { return limited_; }
  /// Returns true if the scope includes a file of this name. Compares names only: accesses no file, so that
  /// the answer tells nothing about files outside. Not RT-safe: allocates.
  bool includes(const std::filesystem::path& file) const;
  /// Returns the directory that contains the file by name; empty if none does. Not RT-safe: allocates.
  std::filesystem::path directory_of(const std::filesystem::path& file) const;
  /// "/etc/wrenchd, /usr/share/wrenchd". Not RT-safe: allocates.
  std::string text() const;

 private:
  bool limited_ = false;
  std::vector<std::filesystem::path> directories_;
};

/// A file was not opened or read. what() is a phrase without the file name: "is a directory".
class FileError : public std::runtime_error {
 public:
  enum class Reason : std::uint8_t {
    not_found,
    directory,    ///< a directory
    not_regular,  ///< a FIFO, a device, a socket
    link,         ///< a symbolic link in a limited scope
    outside,      ///< outside a limited scope
    too_large,
    unreadable,  ///< the system denied access, or reading failed
  };
  FileError(Reason reason, const std::string& phrase) : std::runtime_error(phrase), reason_(reason) {}
  Reason reason() const noexcept { return reason_; }

 private:
  Reason reason_;
};

/// How open_beneath() prevents that a name leaves its directory.
enum class BeneathBy : std::uint8_t {
  kernel,  ///< openat2() with RESOLVE_BENEATH; by steps if the kernel does not have it
  steps,   ///< one directory after the other, none through a link
};

/// Opens a file beneath a directory without following a symbolic link. relative: the name from the directory.
/// Returns no descriptor and sets errno on failure. Not RT-safe: system calls.
OwnedFd open_beneath(const std::filesystem::path& directory, const std::filesystem::path& relative, int flags,
                     BeneathBy by = BeneathBy::kernel);

/// A regular file that was opened once. Its name is not used again, so nobody can replace it between the
/// check and the reading. Not RT-safe: reads a file, which may take long.
class OpenedFile {
 public:
  /// Opens without blocking, whatever the name refers to. Throws FileError.
  OpenedFile(const std::filesystem::path& file, std::uint64_t max_bytes, const FileScope& scope = {});

  int fd() const noexcept { return fd_.get(); }
  /// Size when the file was opened [bytes]. 0 for some files of the kernel that have content.
  std::uint64_t size_bytes() const noexcept { return size_bytes_; }
  /// Returns the content from the start. Throws FileError, also if the file has grown beyond max_bytes.
  std::string read() const;

 private:
  OwnedFd fd_;
  std::uint64_t max_bytes_;
  std::uint64_t size_bytes_ = 0;
};

/// Returns the content of a file. Throws FileError. Not RT-safe: reads a file.
std::string read_file(const std::filesystem::path& file, std::uint64_t max_bytes,
                      const FileScope& scope = {});

}  // namespace wrenchd
