// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tick_selection.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <stdexcept>

#include "config/nearest_key.hpp"

namespace wrenchd {
namespace {

/// Tolerance of the time limits, so that 0.6 s also selects a tick at 0.6000000000000001 s.
constexpr double kRounding_s = 0.5e-9;

template <class T>
void append_as(std::string& to, T number) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  to.append(text.data(), end);
}

template <class T>
void append_from(std::string& to, const std::byte* from) {
  T number;
  std::memcpy(&number, from, sizeof number);
  append_as(to, number);
}

const std::byte* address(const RecordField& field, const void* record, std::size_t component) noexcept {
  return static_cast<const std::byte*>(record) + field.offset + component * size_of(field.type);
}

}  // namespace

std::vector<RecordField> selected_fields(const ExportSettings& settings) {
  const auto all = tick_fields();
  if (settings.columns.empty()) return {all.begin(), all.end()};
  std::vector<RecordField> fields;
  for (const std::string& column : settings.columns) {
    const auto field =
        std::find_if(all.begin(), all.end(), [&](const RecordField& f) { return column == f.name; });
    if (field == all.end()) {
      std::vector<KnownKey> known;
      for (const RecordField& f : all) known.push_back({f.name, ""});
      throw std::invalid_argument("the recording has no column '" + column + "'; " +
                                  nearest_key(column, known).advice);
    }
    fields.push_back(*field);
  }
  return fields;
}

double time_s(const Recording& recording, std::size_t row) noexcept {
  return 1e-9 * static_cast<double>(recording.ticks[row].now_ns - recording.ticks.front().now_ns);
}

std::vector<std::size_t> selected_rows(const Recording& recording, const ExportSettings& settings) {
  std::vector<std::size_t> rows;
  std::size_t within = 0;
  for (std::size_t row = 0; row < recording.ticks.size(); ++row) {
    const double t_s = time_s(recording, row);
    if (t_s < settings.from_s - kRounding_s || t_s > settings.to_s + kRounding_s) continue;
    if (within++ % settings.every == 0) rows.push_back(row);
  }
  return rows;
}

std::string component_suffix(const RecordField& field, std::size_t component) {
  if (field.count == 1) return {};
  return "." + (component < field.components.size() ? std::string(field.components[component].name)
                                                    : std::to_string(component));
}

const char* component_unit(const RecordField& field, std::size_t component) noexcept {
  return component < field.components.size() ? field.components[component].unit : field.unit;
}

void append_number(std::string& to, double number) {
  append_as(to, number);
}

void append_component(std::string& to, const RecordField& field, const void* record, std::size_t component) {
  const std::byte* const from = address(field, record, component);
  switch (field.type) {
    case FieldType::u8:
      return append_as(to, std::to_integer<unsigned>(*from));
    case FieldType::u16:
      return append_from<std::uint16_t>(to, from);
    case FieldType::u32:
      return append_from<std::uint32_t>(to, from);
    case FieldType::u64:
      return append_from<std::uint64_t>(to, from);
    case FieldType::i64:
      return append_from<std::int64_t>(to, from);
    case FieldType::f64:
      return append_from<double>(to, from);
  }
}

double real_component(const RecordField& field, const void* record, std::size_t component) noexcept {
  double number = 0.0;
  std::memcpy(&number, address(field, record, component), sizeof number);
  return number;
}

}  // namespace wrenchd
