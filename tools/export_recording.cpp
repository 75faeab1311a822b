// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/export_recording.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "config/nearest_key.hpp"
#include "daemon/recording/record_fields.hpp"

namespace wrenchd {
namespace {

/// Of a time in nanoseconds as seconds: 0.6 s is wanted where 0.6000000000000001 is.
constexpr double kRounding_s = 0.5e-9;

/// What the numbers of a column are called, and their units.
struct Part {
  const char* name;
  const char* unit;
};
constexpr std::array<Part, 7> kPose = {
    {{"px", "m"}, {"py", "m"}, {"pz", "m"}, {"qx", "1"}, {"qy", "1"}, {"qz", "1"}, {"qw", "1"}}};
constexpr std::array<Part, 6> kWrench = {
    {{"fx", "N"}, {"fy", "N"}, {"fz", "N"}, {"tx", "N.m"}, {"ty", "N.m"}, {"tz", "N.m"}}};
constexpr std::array<Part, 6> kTwist = {
    {{"vx", "m/s"}, {"vy", "m/s"}, {"vz", "m/s"}, {"wx", "rad/s"}, {"wy", "rad/s"}, {"wz", "rad/s"}}};
constexpr std::array<Part, 6> kWay = {
    {{"x", "m"}, {"y", "m"}, {"z", "m"}, {"rx", "rad"}, {"ry", "rad"}, {"rz", "rad"}}};
constexpr std::array<Part, 5> kStages = {
    {{"read", "ns"}, {"projection", "ns"}, {"wrench", "ns"}, {"limits", "ns"}, {"write", "ns"}}};

/// By the unit, which says what it is; by numbers where that is none of these.
std::span<const Part> parts_of(const RecordField& field) {
  const std::string_view unit = field.unit;
  if (field.count == kPose.size()) return kPose;
  if (field.count == kStages.size()) return kStages;
  if (field.count == kWrench.size() && unit.starts_with("N")) return kWrench;
  if (field.count == kTwist.size() && unit.starts_with("m/s")) return kTwist;
  if (field.count == kWay.size() && unit.starts_with("m ")) return kWay;
  return {};
}

std::string heading(const RecordField& field) {
  if (field.count == 1) return std::string(field.name) + " [" + field.unit + "]";
  const auto parts = parts_of(field);
  std::string text;
  for (std::size_t i = 0; i < field.count; ++i)
    text += (i > 0 ? "," : "") + std::string(field.name) + "." +
            (parts.empty() ? std::to_string(i) : std::string(parts[i].name)) + " [" +
            (parts.empty() ? field.unit : parts[i].unit) + "]";
  return text;
}

template <class T>
void add_number(std::string& line, const std::byte* from) {
  T number;
  std::memcpy(&number, from, sizeof number);
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  line.append(text.data(), end);
}

void add(std::string& line, const RecordField& field, const std::vector<std::string>& names,
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
        add_number<std::uint16_t>(line, from);
        break;
      case FieldType::u32:
        add_number<std::uint32_t>(line, from);
        break;
      case FieldType::u64:
        add_number<std::uint64_t>(line, from);
        break;
      case FieldType::i64:
        add_number<std::int64_t>(line, from);
        break;
      case FieldType::f64:
        add_number<double>(line, from);
        break;
    }
  }
}

std::vector<RecordField> wanted(const std::vector<std::string>& columns) {
  const auto all = tick_fields();
  if (columns.empty()) return {all.begin(), all.end()};
  std::vector<RecordField> fields;
  for (const std::string& column : columns) {
    const auto field =
        std::find_if(all.begin(), all.end(), [&](const RecordField& f) { return column == f.name; });
    if (field == all.end()) {
      std::vector<KnownKey> known;
      for (const RecordField& f : all) known.push_back({f.name, ""});
      throw std::invalid_argument("there is no column '" + column + "'; " +
                                  nearest_key(column, known).advice);
    }
    fields.push_back(*field);
  }
  return fields;
}

}  // namespace

void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings) {
  const std::vector<RecordField> fields = wanted(settings.columns);
  std::vector<std::vector<std::string>> names;
  std::string line = "time_s [s]";
  for (const RecordField& field : fields) {
    line += ',' + heading(field);
    names.push_back(is_bits(field.values) ? std::vector<std::string>() : value_names(field.values));
  }
  out << line << '\n';
  if (recording.ticks.empty()) return;
  const std::int64_t start_ns = recording.ticks.front().now_ns;
  std::size_t number = 0;
  for (const TickRecord& tick : recording.ticks) {
    const double time_s = 1e-9 * static_cast<double>(tick.now_ns - start_ns);
    if (time_s < settings.from_s - kRounding_s || time_s > settings.to_s + kRounding_s ||
        number++ % settings.every != 0)
      continue;
    line.clear();
    add_number<double>(line, reinterpret_cast<const std::byte*>(&time_s));
    for (std::size_t i = 0; i < fields.size(); ++i) add(line, fields[i], names[i], tick);
    out << line << '\n';
  }
}

}  // namespace wrenchd
