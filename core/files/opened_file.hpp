// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace wrenchd {

/// Why a file cannot be read.
enum class FileProblem : std::uint8_t {
  missing,      ///< no file has this name
  denied,       ///< the user of this process may not read the file
  not_regular,  ///< a directory, FIFO, device or socket
  outside,      ///< outside of the directories of the scope
  linked,       ///< a symbolic link, where the scope permits none
  too_large,    ///< more bytes than the reader accepts
  unreadable,   ///< an error of the file system
};

/// A file cannot be read. what() is a reason with its remedy and without the name of the file: "is a FIFO;
/// name a regular file".
class FileError : public std::runtime_error {
 public:
  FileError(FileProblem problem, const std::string& reason) : std::runtime_error(reason), problem_(problem) {}
  FileProblem problem() const noexcept { return problem_; }

 private:
  FileProblem problem_;
};

/// States which files may be opened, depending on the source of their names.
class FileScope {
 public:
  /// Any file; symbolic links are followed. For names from a command line or a configuration file.
  FileScope() = default;
  /// Files beneath these directories, reached without a symbolic link. For names from clients of a socket.
  /// The path of a directory itself may contain links. Relative directories start at the working directory.
  /// Not RT-safe: allocates.
  static FileScope beneath(const std::vector<std::filesystem::path>& directories);

  bool restricted() const noexcept { return directories_.has_value(); }
  /// Returns true if the name lies in a directory of the scope. Does not access the file. Not RT-safe:
  /// allocates.
  bool contains(const std::filesystem::path& file) const;
  /// Returns "A, B, C"; empty if the scope is not restricted. Not RT-safe: allocates.
  std::string directories_text() const;

 private:
  friend class OpenedFile;
  /// Splits a name into a directory of the scope and the path beneath it. Precondition: restricted().
  std::optional<std::pair<std::filesystem::path, std::filesystem::path>> split(
      const std::filesystem::path& file) const;

  std::optional<std::vector<std::filesystem::path>> directories_;
};

/// A regular file, open for reading. The constructor opens the name once. All checks and reads use this
/// descriptor, so that a name that changes meanwhile makes no difference. Opening never waits: not for the
/// writer of a FIFO and not for a device. Not RT-safe: system calls.
class OpenedFile {
 public:
  /// Throws FileError.
  explicit OpenedFile(const std::filesystem::path& file, const FileScope& scope = {});
  ~OpenedFile();
  OpenedFile(OpenedFile&& other) noexcept;
  OpenedFile& operator=(OpenedFile&&) = delete;
  OpenedFile(const OpenedFile&) = delete;
  OpenedFile& operator=(const OpenedFile&) = delete;

  int fd() const noexcept { return fd_; }
  std::uint64_t size_bytes() const noexcept { return size_bytes_; }  ///< when the file was opened
  /// Returns the rest of the file. Throws FileError, also if it has more than `most_bytes`.
  std::string read(std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max() / 2);
  /// Returns up to `bytes` bytes from the start of the file, and moves no read position. Throws FileError.
  std::string peek(std::size_t bytes) const;
  /// Gives the descriptor to the caller.
  int release() noexcept { return std::exchange(fd_, -1); }

  /// Selects the fall-back for kernels without openat2 in this process. For tests.
  static void use_fallback(bool wanted) noexcept;

 private:
  int fd_ = -1;
  std::uint64_t size_bytes_ = 0;
};

/// Returns the bytes of a regular file, which is opened once. Throws FileError. Not RT-safe: reads a file.
std::string read_file(const std::filesystem::path& file,
                      std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max() / 2,
                      const FileScope& scope = {});

/// Returns the bytes of a regular file; nothing if it cannot be read. Not RT-safe: reads a file.
std::optional<std::string> read_file_if_readable(
    const std::filesystem::path& file,
    std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max() / 2);

}  // namespace wrenchd
