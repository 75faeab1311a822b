// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/output_file.hpp"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <unistd.h>

namespace wrenchd {
namespace {

using Write = std::function<void(std::ostream&)>;

/// Writes a temporary file beside the target and then renames it, so that the target is complete or
/// unchanged. Keeps a symbolic link.
bool replace_file(const std::filesystem::path& file, const Write& write) {
  std::error_code error;
  const auto place =
      std::filesystem::is_symlink(file, error) ? std::filesystem::weakly_canonical(file, error) : file;
  const std::filesystem::path beside = place.string() + "." + std::to_string(getpid()) + ".part";
  std::ofstream out(beside, std::ios::binary);
  try {
    write(out);
  } catch (...) {
    std::filesystem::remove(beside, error);
    throw;
  }
  out.close();
  if (out) std::filesystem::rename(beside, place, error);
  if (out && !error) return true;
  std::filesystem::remove(beside, error);
  return false;
}

/// Writes directly: a pipe, a terminal or /dev/null cannot be replaced.
bool write_into(const std::filesystem::path& file, const Write& write) {
  std::ofstream out(file, std::ios::binary);
  write(out);
  out.close();
  return !out.fail();
}

}  // namespace

void write_output(const std::string& name, const std::string& text) {
  write_output(name, [&text](std::ostream& out) { out << text; });
}

void write_output(const std::string& name, const std::function<void(std::ostream&)>& write) {
  if (name == "-") return write(std::cout);
  std::error_code ignored;
  const auto status = std::filesystem::status(name, ignored);
  const bool replaceable = !std::filesystem::exists(status) || std::filesystem::is_regular_file(status);
  if (!(replaceable ? replace_file(name, write) : write_into(name, write)))
    throw std::runtime_error(name + ": cannot be written; name a file in an existing, writable directory");
}

}  // namespace wrenchd
