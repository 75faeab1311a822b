// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "config/config_error.hpp"
#include "core/files/opened_file.hpp"

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

/// A configuration file as it was read.
struct ConfigText {
  std::filesystem::path file;
  std::string text;
};

/// One `key = value`; location is that of the key.
struct TomlEntry {
  std::string key;
  SourceLocation location;
  TomlNode node;
};

/// Reads a TOML file; the root is a table at 1:1. Throws ConfigError if the file does not exist, is not
/// regular, is larger than 1 MiB or nested too deeply, or is not valid UTF-8 or TOML. Not RT-safe: reads a
/// file.
TomlNode read_toml_file(const std::filesystem::path& file);
/// Returns the text of a configuration file, with the checks of read_toml_file() that need no parser. scope:
/// where the file may be. Throws ConfigError. Not RT-safe: reads a file.
std::string read_config_text(const std::filesystem::path& file, const FileScope& scope = {});
/// Parses text; `file` is for messages.
TomlNode read_toml_text(const std::string& text, const std::filesystem::path& file);

/// Description of a node for messages: `9000`, `a table`.
std::string describe(const TomlNode& node);

/// The shortest decimal text that reads back as `x`, independent of the locale.
std::string to_text(double x);

}  // namespace wrenchd
