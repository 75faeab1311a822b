// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "config/config_error.hpp"
#include "files/opened_file.hpp"

namespace wrenchd {

struct TomlEntry;

/// A value of a TOML file with its location. Plain data: the parser library stays in toml_file.cpp.
struct TomlNode {
  using Array = std::vector<TomlNode>;
  using Table = std::vector<TomlEntry>;
  /// std::monostate: a date or time, which no format of wrenchd uses.
  using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string, Array, Table>;

  SourceLocation location;
  Value value;
};

/// One `key = value`; location is that of the key.
struct TomlEntry {
  std::string key;
  SourceLocation location;
  TomlNode node;
};

/// The texts of files as they were read. A recording contains these texts, whatever the files contain later.
struct LoadedTexts {
  std::map<std::filesystem::path, std::string> by_file;
  /// The profile, and the profiles that it inherits, the nearest first.
  std::vector<std::filesystem::path> profile_chain;

  /// Returns the text of a file; empty if the file was not read.
  const std::string& of(const std::filesystem::path& file) const;
};

/// Reads a TOML file; the root is a table at 1:1. texts: receives the text, if given. Throws ConfigError if
/// the file does not exist, is outside the scope, is not regular, is larger than 1 MiB or nested too deeply,
/// or is not valid UTF-8 or TOML. Not RT-safe: reads a file.
TomlNode read_toml_file(const std::filesystem::path& file, const FileScope& scope = {},
                        LoadedTexts* texts = nullptr);
/// Parses text; `file` is for messages.
TomlNode read_toml_text(const std::string& text, const std::filesystem::path& file);

/// Description of a node for messages: `9000`, `a table`.
std::string describe(const TomlNode& node);

/// The shortest decimal text that reads back as `x`, independent of the locale.
std::string to_text(double x);

}  // namespace wrenchd
