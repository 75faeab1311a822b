// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/toml_reader.hpp"

#include <algorithm>
#include <cmath>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

std::optional<double> as_number(const TomlNode& node) {
  if (const auto* x = std::get_if<double>(&node.value)) return *x;
  if (const auto* i = std::get_if<std::int64_t>(&node.value)) return static_cast<double>(*i);
  return {};
}

bool inside(double x, Range range) {
  return is_finite(x) && x >= range.min && x <= range.max;
}

/// `"a", "b" or "c"`
std::string alternatives(std::span<const std::string_view> words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? " or " : ", ";
    text += '"' + std::string(words[i]) + '"';
  }
  return text;
}

}  // namespace

bool TomlValue::is_table() const noexcept {
  return node_ && std::holds_alternative<TomlNode::Table>(node_->value);
}

bool TomlValue::is_array() const noexcept {
  return node_ && std::holds_alternative<TomlNode::Array>(node_->value);
}

bool TomlValue::is_text(std::string_view text) const noexcept {
  const auto* s = node_ ? std::get_if<std::string>(&node_->value) : nullptr;
  return s && *s == text;
}

bool TomlValue::has(std::string_view key) const noexcept {
  const auto* table = node_ ? std::get_if<TomlNode::Table>(&node_->value) : nullptr;
  if (!table) return false;
  const auto has_key = [&](const TomlEntry& entry) { return entry.key == key; };
  return std::any_of(table->begin(), table->end(), has_key) && !is_none(key);
}

bool TomlValue::is_none(std::string_view key) const noexcept {
  const auto* table = node_ ? std::get_if<TomlNode::Table>(&node_->value) : nullptr;
  if (!table) return false;
  return std::any_of(table->begin(), table->end(), [&](const TomlEntry& entry) {
    const auto* s = std::get_if<std::string>(&entry.node.value);
    return entry.key == key && s && *s == "none";
  });
}

std::string TomlValue::with_unit(double x) const {
  return to_text(x) + (unit_.empty() ? "" : " " + readable_unit(unit_));
}

std::string TomlValue::range_text(Range range) const {
  return " from " + to_text(range.min) + " to " + with_unit(range.max);
}

std::optional<double> TomlValue::number_in(Range range) const {
  if (!node_) return {};
  const auto x = as_number(*node_);
  if (x && inside(*x, range)) return x;
  reject_found("a number" + range_text(range));
  return {};
}

std::optional<double> TomlValue::whole_number(Range range) const {
  if (!node_) return {};
  const auto x = as_number(*node_);
  if (x && inside(*x, range) && std::trunc(*x) == *x) return x;
  reject_found("a whole number" + range_text(range));
  return {};
}

bool TomlValue::number(double& out, Range range) const {
  const auto x = number_in(range);
  if (x) out = *x;
  return x.has_value();
}

bool TomlValue::boolean(bool& out) const {
  if (!node_) return false;
  const bool* b = std::get_if<bool>(&node_->value);
  if (!b) return reject_found("true or false");
  out = *b;
  return true;
}

bool TomlValue::paragraphs(std::string& out) const {
  if (!node_) return false;
  const auto* s = std::get_if<std::string>(&node_->value);
  if (!s) return reject_found("a text between quotation marks");
  out = *s;
  return true;
}

bool TomlValue::text(std::string& out) const {
  std::string line;
  if (!paragraphs(line)) return false;
  if (std::any_of(line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
    return reject_found("one line without control characters");
  out = std::move(line);
  return true;
}

bool TomlValue::path(std::filesystem::path& out) const {
  std::string name;
  if (!paragraphs(name)) return false;
  if (name.find('\0') != std::string::npos) return reject_found("a file name without a zero byte");
  if (!text(name)) return false;
  out = name;
  return true;
}

bool TomlValue::choose(std::size_t& index, std::span<const std::string_view> words) const {
  if (!node_) return false;
  const auto* word = std::get_if<std::string>(&node_->value);
  const auto found = word ? std::find(words.begin(), words.end(), *word) : words.end();
  if (found == words.end()) {
    const std::string advice =
        word ? nearest_name_advice(*word, std::vector<std::string>(words.begin(), words.end())) : "";
    reject("expected " + alternatives(words) + ", found " + describe(*node_) + advice);
    return false;
  }
  index = static_cast<std::size_t>(found - words.begin());
  return true;
}

bool TomlValue::numbers(std::span<double> out, Range range) const {
  if (!node_) return false;
  const std::string expected = "an array of " + std::to_string(out.size()) + " numbers";
  const auto values = elements(expected);
  if (!is_array()) return false;
  if (values.size() != out.size()) return reject_found(expected);
  std::vector<double> read(out.size());
  bool good = true;
  for (std::size_t i = 0; i < out.size(); ++i) good = values[i].number(read[i], range) && good;
  if (good) std::copy(read.begin(), read.end(), out.begin());
  return good;
}

bool TomlValue::vector(Vector3d& out, Range range) const {
  return numbers({out.data(), 3}, range);
}

std::vector<TomlValue> TomlValue::elements(std::string_view expected) const {
  std::vector<TomlValue> values;
  if (!node_) return values;
  const auto* array = std::get_if<TomlNode::Array>(&node_->value);
  if (!array) reject_found(std::string(expected));
  for (std::size_t i = 0; array && i < array->size(); ++i) {
    const TomlNode& node = (*array)[i];
    values.emplace_back(*rejections_, &node, node.location, name_ + "[" + std::to_string(i) + "]", unit_);
  }
  return values;
}

void TomlValue::reject(const std::string& message) const {
  rejections_->add(location_, "key '" + name_ + "': " + message);
}

bool TomlValue::reject_found(const std::string& expected) const {
  reject("expected " + expected + ", found " + (node_ ? describe(*node_) : "nothing"));
  return false;
}

TomlValue TomlTable::optional(std::string_view key, std::string_view unit) {
  known_.push_back({std::string(key), std::string(unit.empty() ? unit_of(key) : unit)});
  const TomlEntry* entry = find(key);
  const SourceLocation place = entry ? entry->node.location : node_.location;
  return {rejections_, entry ? &entry->node : nullptr, place, dotted(key), known_.back().unit};
}

TomlValue TomlTable::mandatory(std::string_view key, std::string_view unit) {
  if (!find(key)) missing_.push_back({std::string(key), {}});
  return optional(key, unit);
}

TomlValue TomlTable::mandatory_unless(std::string_view other, std::string_view key) {
  if (!find(key) && !find(other)) missing_.push_back({std::string(key), std::string(other)});
  return optional(key);
}

void TomlTable::foreign(std::initializer_list<std::string_view> keys, std::string_view advice) {
  foreign_.assign(keys.begin(), keys.end());
  foreign_advice_ = advice;
}

void TomlTable::close() {
  for (const TomlEntry& entry : std::get<TomlNode::Table>(node_.value)) reject_unknown(entry);
  for (const MissingKey& key : missing_) {
    const std::string cure = key.alternative.empty() ? "it has no default, so state it here"
                                                     : "state it, or '" + key.alternative + "', here";
    rejections_.add(node_.location, "key '" + dotted(key.name) + "' is missing; " + cure);
  }
}

/// A misspelt mandatory key is reported as unknown only, not also as missing.
void TomlTable::reject_unknown(const TomlEntry& entry) {
  const auto same = [&](const KnownKey& key) { return key.name == entry.key; };
  if (std::any_of(known_.begin(), known_.end(), same)) return;
  NearestKey nearest = nearest_key(entry.key, known_);
  if (std::find(foreign_.begin(), foreign_.end(), entry.key) != foreign_.end())
    nearest = {"", foreign_advice_};
  rejections_.add(entry.location,
                  "key '" + dotted(printable(entry.key)) + "' is not known; " + nearest.advice);
  std::erase_if(missing_, [&](const MissingKey& key) {
    return key.name == nearest.name || (!key.alternative.empty() && key.alternative == nearest.name);
  });
}

std::string TomlTable::dotted(std::string_view key) const {
  return name_.empty() ? std::string(key) : name_ + "." + std::string(key);
}

const TomlEntry* TomlTable::find(std::string_view key) const {
  for (const TomlEntry& entry : std::get<TomlNode::Table>(node_.value)) {
    if (entry.key == key) return &entry;
  }
  return nullptr;
}

}  // namespace wrenchd
