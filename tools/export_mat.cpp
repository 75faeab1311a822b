// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/export_mat.hpp"

#include <cstring>
#include <functional>

#include "tools/mat_file.hpp"

namespace wrenchd {
namespace {

using Members = std::vector<std::pair<std::string, std::string>>;

template <class T>
std::string bytes_of(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}

/// Returns a column of `count` records as a matrix, component by component.
std::string field_matrix(const std::string& name, const RecordField& field, std::size_t count,
                         const std::function<const void*(std::size_t)>& record) {
  const std::size_t size = size_of(field.type);
  std::string bytes(count * field.bytes(), '\0');
  char* to = bytes.data();
  for (std::size_t component = 0; component < field.count; ++component)
    for (std::size_t i = 0; i < count; ++i, to += size)
      std::memcpy(to, static_cast<const char*>(record(i)) + field.offset + component * size, size);
  return mat_matrix(name, field.type, count, field.count, bytes);
}

template <class T>
std::string column(const std::string& name, FieldType type, const std::vector<T>& numbers) {
  return mat_matrix(name, type, numbers.size(), 1, bytes_of(numbers));
}

std::string contacts_struct(const Recording& recording, const std::vector<std::size_t>& rows) {
  std::vector<double> of_row;
  std::vector<const Touch*> contacts;
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const Touch& contact : recording.contacts_of(rows[i])) {
      of_row.push_back(static_cast<double>(i + 1));
      contacts.push_back(&contact);
    }
  Members members = {{"row", column("", FieldType::f64, of_row)}};
  for (const RecordField& field : contact_fields())
    if (std::string(field.name) != "padding")
      members.emplace_back(
          field.name, field_matrix("", field, contacts.size(), [&](std::size_t i) { return contacts[i]; }));
  return mat_struct("contact_rows", members);
}

std::string events_struct(const Recording& recording) {
  std::vector<double> times_s, values;
  std::vector<std::int64_t> ticks;
  std::vector<std::uint8_t> severities;
  std::vector<std::string> names, texts, conditions;
  const std::int64_t start_ns = recording.ticks.empty() ? 0 : recording.ticks.front().now_ns;
  for (const RecordedEvent& event : recording.events) {
    times_s.push_back(1e-9 * static_cast<double>(event.time_ns - start_ns));
    ticks.push_back(event.tick);
    severities.push_back(static_cast<std::uint8_t>(event.severity));
    values.push_back(event.value);
    names.push_back(event.name);
    texts.push_back(event.text);
    conditions.push_back(event.conditions);
  }
  const Members members = {{"time_s", column("", FieldType::f64, times_s)},
                           {"tick", column("", FieldType::i64, ticks)},
                           {"severity", column("", FieldType::u8, severities)},
                           {"name", mat_texts("", names)},
                           {"text", mat_texts("", texts)},
                           {"value", column("", FieldType::f64, values)},
                           {"conditions", mat_texts("", conditions)}};
  return mat_struct("events", members);
}

}  // namespace

void write_mat(std::ostream& out, const Recording& recording, const ExportSettings& settings) {
  const std::vector<RecordField> fields = selected_fields(settings);
  const std::vector<std::size_t> rows = selected_rows(recording, settings);
  std::vector<double> times_s;
  for (const std::size_t row : rows) times_s.push_back(time_s(recording, row));
  out << mat_header() << column("time_s", FieldType::f64, times_s);
  Members units = {{"time_s", mat_text("", "s")}}, meaning, names;
  for (const RecordField& field : fields) {
    out << field_matrix(field.name, field, rows.size(),
                        [&](std::size_t i) { return &recording.ticks[rows[i]]; });
    units.emplace_back(field.name, mat_text("", field.unit));
    const std::string frame = field.frame;
    meaning.emplace_back(field.name, mat_text("", field.doc + (frame.empty() ? "" : "; " + frame)));
    if (const auto values = value_names(field.values); !values.empty())
      names.emplace_back(field.name, mat_texts("", values));
  }
  out << contacts_struct(recording, rows) << events_struct(recording) << mat_struct("units", units)
      << mat_struct("meaning", meaning) << mat_struct("names", names);
}

}  // namespace wrenchd
