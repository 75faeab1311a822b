// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/toml_file.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string_view>

#include <toml++/toml.h>

#include "config/near_file.hpp"
#include "core/files/absolute_name.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// The largest shipped file has 8 kB. A file above 1 MiB is a mesh or a recording.
constexpr std::uint64_t kMaxBytes = 1 << 20;

/// wrenchd's formats nest four levels.
constexpr int kMaxDepth = 16;

/// The parser limits the nesting of brackets but not of dotted keys, and it frees its tree recursively. A key
/// with 500,000 dots would overflow the stack. wrenchd's formats need less than a tenth of this limit.
constexpr std::ptrdiff_t kMaxDotsInLine = 120;

/// Names a file of a similar name only if the name comes from a user of this process, not from a client.
std::string missing_text(const fs::path& file, const FileScope& scope) {
  const fs::path near = scope.restricted() ? fs::path() : near_file(file);
  return "no such file; searched " + absolute_name(file).string() +
         (near.empty() ? "" : "; did you mean '" + near.string() + "'?");
}

std::string read_text(const fs::path& file, const FileScope& scope) {
  try {
    return read_file(file, kMaxBytes, scope);
  } catch (const FileError& error) {
    switch (error.problem()) {
      case FileProblem::missing:
        throw ConfigError(file, {}, missing_text(file, scope));
      case FileProblem::too_large:
        throw ConfigError(file, {}, "is larger than 1 MiB; is this really a configuration file?");
      default:
        throw ConfigError(file, {}, error.what());
    }
  }
}

void reject_many_dots(const fs::path& file, std::string_view text) {
  unsigned line = 1;
  while (!text.empty()) {
    const std::size_t length = std::min(text.find('\n'), text.size());
    if (std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(length), '.') > kMaxDotsInLine) {
      throw ConfigError(file, {line, 1},
                        "has more than " + std::to_string(kMaxDotsInLine) +
                            " dots in one line; break the line, or nest its keys less deeply");
    }
    text.remove_prefix(std::min(length + 1, text.size()));
    ++line;
  }
}

SourceLocation to_place(const toml::source_region& source) {
  return {source.begin.line, source.begin.column};
}

TomlNode convert(const fs::path& file, const toml::node& node, int depth);

TomlNode::Table convert_table(const fs::path& file, const toml::table& table, int depth) {
  TomlNode::Table out;
  for (const auto& [key, node] : table) {
    out.push_back({std::string(key.str()), to_place(key.source()), convert(file, node, depth)});
  }
  return out;
}

TomlNode::Array convert_array(const fs::path& file, const toml::array& array, int depth) {
  TomlNode::Array out;
  for (const toml::node& node : array) out.push_back(convert(file, node, depth));
  return out;
}

TomlNode::Value convert_value(const fs::path& file, const toml::node& node, int depth) {
  if (const auto* table = node.as_table()) return convert_table(file, *table, depth);
  if (const auto* array = node.as_array()) return convert_array(file, *array, depth);
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* number = node.as_floating_point()) return number->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* boolean = node.as_boolean()) return boolean->get();
  return std::monostate{};
}

TomlNode convert(const fs::path& file, const toml::node& node, int depth) {
  const SourceLocation place = to_place(node.source());
  if (depth > kMaxDepth) {
    throw ConfigError(file, place, "is nested more than " + std::to_string(kMaxDepth) + " deep; flatten it");
  }
  return {place, convert_value(file, node, depth + 1)};
}

/// Message for a syntax error. The parser's description may quote the file at length, so it is truncated.
std::string syntax_message(std::string_view description) {
  std::string message = "is not valid TOML: " + printable(std::string(description), 200);
  if (description.find("redefine") != std::string_view::npos)
    message += "; a key may appear once only, keep one of them";
  if (description.find("nested") != std::string_view::npos) message += "; flatten it";
  if (description.find("utf-8") != std::string_view::npos) message += "; save the file as UTF-8";
  return message;
}

}  // namespace

std::string read_config_text(const fs::path& file, const FileScope& scope) {
  return read_text(file, scope);
}

TomlNode read_toml_file(const fs::path& file) {
  return read_toml_text(read_text(file, {}), file);
}

TomlNode read_toml_text(const std::string& text, const fs::path& file) {
  reject_many_dots(file, text);
  try {
    return convert(file, toml::parse(std::string_view(text)), 0);
  } catch (const toml::parse_error& error) {
    throw ConfigError(file, to_place(error.source()), syntax_message(error.description()));
  }
}

std::string to_text(double x) {
  const double size = std::abs(x);
  const bool plain = size == 0.0 || (size >= 1e-4 && size < 1e9);
  const auto format = plain ? std::chars_format::fixed : std::chars_format::general;
  char buffer[32];
  const auto end = std::to_chars(std::begin(buffer), std::end(buffer), x, format);
  return {std::begin(buffer), end.ptr};
}

std::string describe(const TomlNode& node) {
  struct Words {
    std::string operator()(std::monostate) const { return "a date or time"; }
    std::string operator()(bool b) const { return b ? "true" : "false"; }
    std::string operator()(std::int64_t i) const { return std::to_string(i); }
    std::string operator()(double x) const { return to_text(x); }
    std::string operator()(const std::string& s) const { return "the text \"" + printable(s) + '"'; }
    std::string operator()(const TomlNode::Array& a) const {
      return "an array of " + std::to_string(a.size());
    }
    std::string operator()(const TomlNode::Table&) const { return "a table"; }
  };
  return std::visit(Words{}, node.value);
}

}  // namespace wrenchd
