// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/export_recording.hpp"

#include <cstring>
#include <string>

#include "tools/marker_columns.hpp"

namespace wrenchd {
namespace {

/// Returns the column headings of a field, one for each component: ",F_out.fx [N],F_out.fy [N],...".
std::string heading(const RecordField& field) {
  std::string text;
  for (std::size_t i = 0; i < field.count; ++i)
    text +=
        "," + std::string(field.name) + component_suffix(field, i) + " [" + component_unit(field, i) + "]";
  return text;
}

/// Returns a cell as RFC 4180 has it: in quotes if it contains a comma or a quote.
std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  return cell + '"';
}

void append_field(std::string& line, const RecordField& field, const std::vector<std::string>& names,
                  const TickRecord& tick) {
  for (std::size_t i = 0; i < field.count; ++i) {
    line += ',';
    std::uint8_t number = 0;
    if (field.type == FieldType::u8)
      std::memcpy(&number, reinterpret_cast<const std::byte*>(&tick) + field.offset + i, 1);
    if (field.type == FieldType::u8 && number < names.size())
      line += names[number];
    else
      append_component(line, field, &tick, i);
  }
}

void append_markers(std::string& line, const MarkerColumns& markers, std::int64_t now_ns) {
  const MarkerColumns::Step* const step = markers.at(now_ns);
  line += "," + (step == nullptr ? std::string() : csv_text(step->label));
  for (std::size_t i = 0; i < markers.conditions().size(); ++i) {
    line += ',';
    if (step == nullptr || step->values[i].is_null()) continue;
    if (step->values[i].is_number())
      append_number(line, step->values[i].get<double>());
    else
      line +=
          csv_text(step->values[i].is_string() ? step->values[i].get<std::string>() : step->values[i].dump());
  }
}

}  // namespace

void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings) {
  const std::vector<RecordField> fields = selected_fields(settings);
  const MarkerColumns markers(recording);
  std::vector<std::vector<std::string>> names;
  std::string line = "time_s [s]";
  for (const RecordField& field : fields) {
    line += heading(field);
    names.push_back(is_bits(field.values) ? std::vector<std::string>() : value_names(field.values));
  }
  if (!markers.empty()) {
    line += ",marker";
    for (const std::string& name : markers.conditions()) line += "," + csv_text(name);
  }
  out << line << '\n';
  for (const std::size_t row : selected_rows(recording, settings)) {
    const TickRecord& tick = recording.ticks[row];
    line.clear();
    append_number(line, time_s(recording, row));
    for (std::size_t i = 0; i < fields.size(); ++i) append_field(line, fields[i], names[i], tick);
    if (!markers.empty()) append_markers(line, markers, tick.now_ns);
    out << line << '\n';
  }
}

}  // namespace wrenchd
