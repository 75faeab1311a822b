// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace wrenchd {

/// Line and column in a file, both from 1. Line 0: the file as a whole.
struct SourceLocation {
  unsigned line = 0;
  unsigned column = 0;
  std::shared_ptr<const std::filesystem::path> file =
      nullptr;  ///< where it is not the one being read: a parent
};

/// One thing wrong with a file: where, what was expected, what was found, and the cure.
struct Refusal {
  std::filesystem::path file;
  SourceLocation location;
  std::string message;
};

/// "FILE:LINE:COLUMN: message", the form editors and terminals can jump to.
std::string to_text(const Refusal& refusal);

/// A user's text as a message may repeat it: cut short, on one line.
std::string printable(std::string text, std::size_t longest = 60);

/// A file was refused. what() holds one line for each refusal, in the order of the file.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<Refusal> refusals);
  ConfigError(std::filesystem::path file, SourceLocation place, std::string message);

  const std::vector<Refusal>& refusals() const noexcept { return refusals_; }

 private:
  std::vector<Refusal> refusals_;
};

/// Gathers what is wrong with one file, so that a user sees all of it at once.
class RefusalList {
 public:
  explicit RefusalList(std::filesystem::path file) : file_(std::move(file)) {}

  void add(SourceLocation place, std::string message);
  void throw_if_any();

 private:
  std::filesystem::path file_;
  std::vector<Refusal> refusals_;
};

}  // namespace wrenchd
