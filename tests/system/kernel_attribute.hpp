// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace wrenchd::test {

/// Returns the first line of an attribute of the kernel, a file in /sys; empty if there is none.
inline std::string read_attribute(const std::filesystem::path& file) {
  std::string text;
  std::ifstream in(file);
  std::getline(in, text);
  return text;
}

/// Throws std::runtime_error with the file if the kernel rejects the value.
template <class Value>
void write_attribute(const std::filesystem::path& file, const Value& value) {
  std::ofstream out(file, std::ios::binary);
  out << value << std::flush;
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace wrenchd::test
