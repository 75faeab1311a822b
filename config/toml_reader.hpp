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

/// What a number may be; both ends belong to it. NaN and infinities never do.
struct Range {
  double min;
  double max;
};

/// The value of a key that was asked for, present or not.
///
/// Each conversion returns true when the value is there and good. A value that is there and not good is
/// refused, with its place, what was expected and what was found, and `out` keeps what it had: its default.
class TomlValue {
 public:
  TomlValue(RefusalList& refusals, const TomlNode* node, SourceLocation place, std::string name,
            std::string unit)
      : refusals_(&refusals),
        node_(node),
        location_(std::move(place)),
        name_(std::move(name)),
        unit_(std::move(unit)) {}

  explicit operator bool() const noexcept { return node_ != nullptr; }
  bool is_table() const noexcept;
  bool is_array() const noexcept;
  /// Is it this very text? "none" stands for something a device does not have.
  bool is_text(std::string_view text) const noexcept;
  /// Does the table hold this key, with anything but the text "none"?
  bool has(std::string_view key) const noexcept;
  /// Does the table hold this key with the text "none"?
  bool is_none(std::string_view key) const noexcept;
  /// Does it come from a profile that the file inherits?
  bool is_inherited() const noexcept { return location_.file != nullptr; }
  const std::string& name() const noexcept { return name_; }  ///< dotted, as in "obstacle[0].half_space"

  bool number(double& out, Range range) const;  ///< an integer will do
  template <std::integral T>
  bool integer(T& out, Range range) const;  ///< 45.0 will do, 45.5 will not
  bool boolean(bool& out) const;
  bool text(std::string& out) const;
  bool path(std::filesystem::path& out) const;
  template <typename E>
  bool choice(E& out, std::initializer_list<std::pair<std::string_view, E>> choices) const;

  bool numbers(std::span<double> out, Range range) const;  ///< exactly out.size() of them
  bool vector(Vector3d& out, Range range) const;
  std::vector<TomlValue> elements(std::string_view expected) const;  ///< of an array

  /// Calls read(TomlTable&, args...), then refuses the keys it did not ask for.
  template <typename Read, typename... Args>
  void table(Read read, Args&&... args) const;
  /// The same, and a table that is not there is read as an empty one: for defaults that have to be looked up.
  template <typename Read, typename... Args>
  void table_or_empty(Read read, Args&&... args) const;

  /// A number with the unit of this key, for messages: "10 N".
  std::string with_unit(double x) const;

  /// "key 'NAME': MESSAGE" at the value; where there is none, at the table that lacks it.
  void refuse(const std::string& message) const;
  /// "key 'NAME': expected EXPECTED, found ...". Returns false.
  bool refuse_found(const std::string& expected) const;

 private:
  std::string range_text(Range range) const;
  std::optional<double> number_in(Range range) const;
  std::optional<double> whole_number(Range range) const;
  bool choose(std::size_t& index, std::span<const std::string_view> words) const;

  RefusalList* refusals_;
  const TomlNode* node_;
  SourceLocation location_;
  std::string name_;
  std::string unit_;
};

/// A table, and the keys somebody asked it for. A loader asks for every key its format has, so the loader
/// reads as the format's description, and what is left over is a mistake.
class TomlTable {
  struct MissingKey {
    std::string name;
    std::string alternative;  ///< would do as well; may be empty
  };

 public:
  TomlTable(RefusalList& refusals, const TomlNode& node, std::string name)
      : refusals_(refusals), node_(node), name_(std::move(name)) {}

  /// The unit is the one the key name ends with, unless it is given here.
  TomlValue optional(std::string_view key, std::string_view unit = {});
  TomlValue mandatory(std::string_view key, std::string_view unit = {});
  /// Where another key, which is optional, would do as well. Both have been asked for then.
  TomlValue mandatory_unless(std::string_view other, std::string_view key);

  /// Refuses keys that nobody asked for, and mandatory keys that are not there.
  void close();

 private:
  std::string dotted(std::string_view key) const;
  const TomlEntry* find(std::string_view key) const;
  void refuse_unknown(const TomlEntry& entry);

  RefusalList& refusals_;
  const TomlNode& node_;
  std::string name_;
  std::vector<KnownKey> known_;
  std::vector<MissingKey> missing_;
};

/// Reads a root table, which stands in FILE, through read(TomlTable&, args...). Throws one ConfigError that
/// tells everything wrong with it.
template <typename Read, typename... Args>
void read_toml_node(const std::filesystem::path& file, const TomlNode& node, Read read, Args&&... args) {
  RefusalList refusals(file);
  TomlTable root(refusals, node, "");
  read(root, args...);
  root.close();
  refusals.throw_if_any();
}

/// The same of FILE as it is.
template <typename Read, typename... Args>
void read_toml(const std::filesystem::path& file, Read read, Args&&... args) {
  read_toml_node(file, read_toml_file(file), read, args...);
}

/// The same of text that was read already; `file` is for messages.
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
  if (!is_table()) return void(refuse_found("a table"));
  TomlTable table(*refusals_, *node_, name_);
  read(table, args...);
  table.close();
}

template <typename Read, typename... Args>
void TomlValue::table_or_empty(Read read, Args&&... args) const {
  if (node_) return table(read, args...);
  const TomlNode empty{location_, TomlNode::Table{}};
  TomlValue(*refusals_, &empty, location_, name_, unit_).table(read, args...);
}

}  // namespace wrenchd
