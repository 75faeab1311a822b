// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <concepts>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/config_error.hpp"
#include "config/nearest_key.hpp"
#include "config/toml_file.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Closed interval of a number. NaN and infinity are always outside.
struct Range {
  double min;
  double max;
};

/// The value of a requested key, present or absent.
///
/// Each conversion returns true if the value is present and valid. It rejects an invalid value with location,
/// expected and found value, and then leaves `out` at its default. Not RT-safe: allocates.
class TomlValue {
 public:
  TomlValue(RejectionList& rejections, const TomlNode* node, SourceLocation place, std::string name,
            std::string unit)
      : rejections_(&rejections),
        node_(node),
        location_(std::move(place)),
        name_(std::move(name)),
        unit_(std::move(unit)) {}

  explicit operator bool() const noexcept { return node_ != nullptr; }
  bool is_table() const noexcept;
  bool is_array() const noexcept;
  /// True if the value is exactly this text. "none" stands for an absent feature of a device.
  bool is_text(std::string_view text) const noexcept;
  /// True if the table has this key and its value is not the text "none".
  bool has(std::string_view key) const noexcept;
  /// True if the table has this key with the text "none".
  bool is_none(std::string_view key) const noexcept;
  /// True if the value comes from an inherited profile.
  bool is_inherited() const noexcept { return location_.file != nullptr; }
  /// Location of the value; of its table if the value is absent.
  const SourceLocation& location() const noexcept { return location_; }
  const std::string& name() const noexcept { return name_; }  ///< dotted name, as in "obstacle[0].half_space"

  bool number(double& out, Range range) const;  ///< accepts an integer
  template <std::integral T>
  bool integer(T& out, Range range) const;  ///< accepts 45.0, rejects 45.5
  bool boolean(bool& out) const;
  /// One line. Rejects control characters, because names reach logs, status lines and udev rules.
  bool text(std::string& out) const;
  /// A text of any number of lines.
  bool paragraphs(std::string& out) const;
  bool path(std::filesystem::path& out) const;
  template <typename E>
  bool choice(E& out, std::initializer_list<std::pair<std::string_view, E>> choices) const;

  bool numbers(std::span<double> out, Range range) const;  ///< exactly out.size() numbers
  bool vector(Vector3d& out, Range range) const;
  std::vector<TomlValue> elements(std::string_view expected) const;  ///< elements of an array

  /// Calls read(TomlTable&, args...), then rejects the keys that were not requested.
  template <typename Read, typename... Args>
  void table(Read read, Args&&... args) const;
  /// Calls read(TomlTable&, args...) with an empty table if the table is absent, for defaults that need a
  /// lookup.
  template <typename Read, typename... Args>
  void table_or_empty(Read read, Args&&... args) const;

  /// A number with the unit of this key, for messages: "10 N".
  std::string with_unit(double x) const;

  /// Rejects the value with "key 'NAME': MESSAGE", located at the value, or at the table if it is absent.
  void reject(const std::string& message) const;
  /// Rejects the value with "key 'NAME': expected EXPECTED, found ...". Returns false.
  bool reject_found(const std::string& expected) const;

 private:
  std::string range_text(Range range) const;
  std::optional<double> number_in(Range range) const;
  std::optional<double> whole_number(Range range) const;
  bool choose(std::size_t& index, std::span<const std::string_view> words) const;

  RejectionList* rejections_;
  const TomlNode* node_;
  SourceLocation location_;
  std::string name_;
  std::string unit_;
};

/// A table that tracks the requested keys. A loader requests every key of its format, so the loader documents
/// the format; close() rejects all other keys.
class TomlTable {
  struct MissingKey {
    std::string name;
    std::string alternative;  ///< optional key that satisfies the requirement instead; may be empty
  };

 public:
  TomlTable(RejectionList& rejections, const TomlNode& node, std::string name)
      : rejections_(rejections), node_(node), name_(std::move(name)) {}

  /// The unit of the value is the ending of the key, unless `unit` is given.
  TomlValue optional(std::string_view key, std::string_view unit = {});
  TomlValue mandatory(std::string_view key, std::string_view unit = {});
  /// A mandatory key, unless the optional key `other` is present. Both keys count as requested.
  TomlValue mandatory_unless(std::string_view other, std::string_view key);

  /// Names the keys of another kind of file. They are unknown here; the advice for one of them says which
  /// file this is, and where to give it.
  void foreign(std::initializer_list<std::string_view> keys, std::string_view advice);

  /// Rejects unknown keys and missing mandatory keys.
  void close();

 private:
  std::string dotted(std::string_view key) const;
  const TomlEntry* find(std::string_view key) const;
  void reject_unknown(const TomlEntry& entry);

  RejectionList& rejections_;
  const TomlNode& node_;
  std::string name_;
  std::vector<KnownKey> known_;
  std::vector<MissingKey> missing_;
  std::vector<std::string> foreign_;  ///< keys of another kind of file
  std::string foreign_advice_;
};

/// Reads a root table of FILE through read(TomlTable&, args...). Throws one ConfigError with all defects.
template <typename Read, typename... Args>
void read_toml_node(const std::filesystem::path& file, const TomlNode& node, Read read, Args&&... args) {
  RejectionList rejections(file);
  TomlTable root(rejections, node, "");
  read(root, args...);
  root.close();
  rejections.throw_if_any();
}

/// Reads FILE through read(TomlTable&, args...).
template <typename Read, typename... Args>
void read_toml(const std::filesystem::path& file, Read read, Args&&... args) {
  read_toml_node(file, read_toml_file(file), read, args...);
}

/// Parses text and reads it through read(TomlTable&, args...); `file` is for messages.
template <typename Read, typename... Args>
void read_toml_text(const std::string& text, const std::filesystem::path& file, Read read, Args&&... args) {
  read_toml_node(file, read_toml_text(text, file), read, args...);
}

template <std::integral T>
bool TomlValue::integer(T& out, Range range) const {
  const auto whole = whole_number(range);
  if (whole) out = static_cast<T>(*whole);
  return whole.has_value();
}

template <typename E>
bool TomlValue::choice(E& out, std::initializer_list<std::pair<std::string_view, E>> choices) const {
  std::vector<std::string_view> words;
  for (const auto& [word, value] : choices) words.push_back(word);
  std::size_t index = 0;
  if (!choose(index, words)) return false;
  out = (choices.begin() + index)->second;
  return true;
}

template <typename Read, typename... Args>
void TomlValue::table(Read read, Args&&... args) const {
  if (!node_) return;
  if (!is_table()) return void(reject_found("a table"));
  TomlTable table(*rejections_, *node_, name_);
  read(table, args...);
  table.close();
}

template <typename Read, typename... Args>
void TomlValue::table_or_empty(Read read, Args&&... args) const {
  if (node_) return table(read, args...);
  const TomlNode empty{location_, TomlNode::Table{}};
  TomlValue(*rejections_, &empty, location_, name_, unit_).table(read, args...);
}

}  // namespace wrenchd
