// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "config/config_error.hpp"

namespace wrenchd {

struct TomlEntry;

/// One value of a TOML file and where it stands. Plain data: the parser library stays in toml_file.cpp.
struct TomlNode {
  using Array = std::vector<TomlNode>;
  using Table = std::vector<TomlEntry>;
  /// std::monostate stands for a date or a time, which no file of ours asks for.
  using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string, Array, Table>;

  SourceLocation location;
  Value value;
};

/// One `key = value`; the place is the key's, the value has its own.
struct TomlEntry {
  std::string key;
  SourceLocation location;
  TomlNode node;
};

/// Reads FILE. The root is a table at 1:1. Throws ConfigError when there is no such file, when it is not a
/// regular file, is unreasonably large or deeply nested, or is not valid UTF-8 or TOML.
TomlNode read_toml_file(const std::filesystem::path& file);
/// The same of text that was read already; `file` is for messages.
TomlNode read_toml_text(const std::string& text, const std::filesystem::path& file);

/// What a node is, for messages: `the number 9000`, `a table`.
std::string describe(const TomlNode& node);

/// The shortest decimal text that reads back as `x`, whatever the locale.
std::string to_text(double x);

}  // namespace wrenchd
