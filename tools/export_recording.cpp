// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/export_recording.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "config/nearest_key.hpp"
#include "daemon/servo/record_fields.hpp"

namespace wrenchd {
namespace {

/// Tolerance of the time limits, so that 0.6 s also selects a tick at 0.6000000000000001 s.
constexpr double kRounding_s = 0.5e-9;

/// Returns the column headings of a field, one for each component: "F_out.fx [N],F_out.fy [N],...".
std::string heading(const RecordField& field) {
  if (field.count == 1) return std::string(field.name) + " [" + field.unit + "]";
  std::string text;
  for (std::size_t i = 0; i < field.count; ++i) {
    const bool named = i < field.components.size();
    text += (i > 0 ? "," : "") + std::string(field.name) + "." +
            (named ? field.components[i].name : std::to_string(i)) + " [" +
            (named ? field.components[i].unit : field.unit) + "]";
  }
  return text;
}

template <class T>
void append_number(std::string& line, const std::byte* from) {
  T number;
  std::memcpy(&number, from, sizeof number);
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  line.append(text.data(), end);
}

void append_field(std::string& line, const RecordField& field, const std::vector<std::string>& names,
                  const TickRecord& tick) {
  const std::byte* from = reinterpret_cast<const std::byte*>(&tick) + field.offset;
  for (std::size_t i = 0; i < field.count; ++i, from += size_of(field.type)) {
    line += ',';
    switch (field.type) {
      case FieldType::u8: {
        const auto number = std::to_integer<std::uint8_t>(*from);
        if (number < names.size())
          line += names[number];
        else
          line += std::to_string(number);
        break;
      }
      case FieldType::u16:
        append_number<std::uint16_t>(line, from);
        break;
      case FieldType::u32:
        append_number<std::uint32_t>(line, from);
        break;
      case FieldType::u64:
        append_number<std::uint64_t>(line, from);
        break;
      case FieldType::i64:
        append_number<std::int64_t>(line, from);
        break;
      case FieldType::f64:
        append_number<double>(line, from);
        break;
    }
  }
}

/// Returns the fields of these names, in this order; all fields if the list is empty.
std::vector<RecordField> select_fields(const std::vector<std::string>& columns) {
  const auto all = tick_fields();
  if (columns.empty()) return {all.begin(), all.end()};
  std::vector<RecordField> fields;
  for (const std::string& column : columns) {
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

}  // namespace

void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings) {
  const std::vector<RecordField> fields = select_fields(settings.columns);
  std::vector<std::vector<std::string>> names;
  std::string line = "time_s [s]";
  for (const RecordField& field : fields) {
    line += ',' + heading(field);
    names.push_back(is_bits(field.values) ? std::vector<std::string>() : value_names(field.values));
  }
  out << line << '\n';
  if (recording.ticks.empty()) return;
  const std::int64_t start_ns = recording.ticks.front().now_ns;
  std::size_t selected = 0;
  for (const TickRecord& tick : recording.ticks) {
    const double time_s = 1e-9 * static_cast<double>(tick.now_ns - start_ns);
    if (time_s < settings.from_s - kRounding_s || time_s > settings.to_s + kRounding_s ||
        selected++ % settings.every != 0)
      continue;
    line.clear();
    append_number<double>(line, reinterpret_cast<const std::byte*>(&time_s));
    for (std::size_t i = 0; i < fields.size(); ++i) append_field(line, fields[i], names[i], tick);
    out << line << '\n';
  }
}

}  // namespace wrenchd
