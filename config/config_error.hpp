// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace wrenchd {

/// Line and column in a file, from 1. Line 0: the whole file.
struct SourceLocation {
  unsigned line = 0;
  unsigned column = 0;
  std::shared_ptr<const std::filesystem::path> file =
      nullptr;  ///< file, if it is not the file being read: an inherited profile
};

/// One defect of a file: location, expected value, found value and remedy.
struct Rejection {
  std::filesystem::path file;
  SourceLocation location;
  std::string message;
};

/// "FILE:LINE:COLUMN: message", which editors and terminals can open.
std::string to_text(const Rejection& rejection);

/// The text as a message may quote it: truncated to `longest` bytes, control characters replaced.
std::string printable(std::string text, std::size_t longest = 60);

/// A file was rejected. what() has one line per defect, in file order.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<Rejection> rejections);
  ConfigError(std::filesystem::path file, SourceLocation place, std::string message);

  const std::vector<Rejection>& rejections() const noexcept { return rejections_; }
  /// Returns the message for someone who may read only the file `readable`: of the defects in all other files
  /// the location, and nothing that the files contain. Not RT-safe: allocates.
  std::string public_text(const std::filesystem::path& readable) const;

 private:
  std::vector<Rejection> rejections_;
};

/// Collects all defects of one file, so that the user sees them at once.
class RejectionList {
 public:
  explicit RejectionList(std::filesystem::path file) : file_(std::move(file)) {}

  void add(SourceLocation place, std::string message);
  void throw_if_any();

 private:
  std::filesystem::path file_;
  std::vector<Rejection> rejections_;
};

}  // namespace wrenchd
