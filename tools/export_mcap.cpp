// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/export_mcap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "daemon/version.hpp"
#include "tools/marker_columns.hpp"
#include "tools/mcap_writer.hpp"

namespace wrenchd {
namespace {

constexpr const char* kTime =
    R"("timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},"nsec":{"type":"integer"}}})";
constexpr const char* kVector =
    R"({"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"}}})";
constexpr const char* kQuaternion =
    R"({"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"},"w":{"type":"number"}}})";
constexpr const char* kText = R"({"type":"string"})";

std::string schema_of(const std::string& title, const std::string& properties) {
  return R"({"title":")" + title + R"(","type":"object","properties":{)" + kTime + "," + properties + "}}";
}

std::string json_text(const std::string& text) {
  return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

void append_real(std::string& to, double number) {
  if (std::isfinite(number))
    append_number(to, number);
  else
    to += "null";
}

/// Appends an object {"x": numbers[0], ...} with one name for each number.
void append_object(std::string& to, std::string_view names, const double* numbers) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    to += i == 0 ? '{' : ',';
    (to += '"') += names[i];
    to += "\":";
    append_real(to, numbers[i]);
  }
  to += '}';
}

/// Returns the schema of the columns: one property for each field, with unit and meaning.
std::string tick_schema(const std::vector<RecordField>& fields) {
  std::string properties = R"("time_s":{"type":"number","description":"time since the first tick [s]"})";
  for (const RecordField& field : fields) {
    const bool named = !is_bits(field.values) && !value_names(field.values).empty();
    const std::string number = named                          ? R"("type":"string")"
                               : field.type == FieldType::f64 ? R"("type":["number","null"])"
                                                              : R"("type":"integer")";
    properties += ",\"" + std::string(field.name) + "\":{\"description\":" +
                  json_text(std::string(field.doc) + " [" + field.unit + "]" +
                            (*field.frame != '\0' ? "; " + std::string(field.frame) : ""));
    if (field.count == 1) {
      properties += "," + number + "}";
      continue;
    }
    properties += R"(,"type":"object","properties":{)";
    for (std::size_t i = 0; i < field.count; ++i)
      properties += (i > 0 ? ",\"" : "\"") + component_suffix(field, i).substr(1) + "\":{" + number + "}";
    properties += "}}";
  }
  return schema_of("wrenchd.Tick", properties);
}

/// Converts the times of a recording to UTC.
struct UtcTime {
  std::int64_t offset_ns;
  std::uint64_t ns(std::int64_t now_ns) const {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(offset_ns + now_ns, 0));
  }
  std::string json(std::int64_t now_ns) const {
    const std::uint64_t utc_ns = ns(now_ns);
    return R"({"timestamp":{"sec":)" + std::to_string(utc_ns / 1'000'000'000) + R"(,"nsec":)" +
           std::to_string(utc_ns % 1'000'000'000) + "}";
  }
};

bool is_finite(const TickRecord::PoseNumbers& pose) {
  return std::all_of(pose.begin(), pose.end(), [](double x) { return std::isfinite(x); });
}

/// Writes the messages of one recording.
class McapExport {
 public:
  McapExport(std::ostream& out, const Recording& recording, const ExportSettings& settings)
      : recording_(recording),
        fields_(selected_fields(settings)),
        rows_(selected_rows(recording, settings)),
        markers_(recording),
        utc_{recording.header.started_unix_ns - recording.header.started_ns},
        writer_(out, std::string("wrenchd ") + kVersion) {
    for (const RecordField& field : fields_)
      names_.push_back(is_bits(field.values) ? std::vector<std::string>() : value_names(field.values));
    add_channels();
  }

  /// Messages are written in the order of their times: an event or a marker before the first tick that is
  /// later.
  void run() {
    const auto& events = recording_.events;
    const auto& steps = markers_.steps();
    std::vector<std::size_t> order(events.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return events[a].time_ns < events[b].time_ns; });
    std::size_t event = 0, step = 0;
    const auto write_until = [&](std::int64_t now_ns) {
      for (; event < order.size() && events[order[event]].time_ns <= now_ns; ++event)
        write_event(events[order[event]]);
      for (; step < steps.size() && steps[step].time_ns <= now_ns; ++step) write_conditions(steps[step]);
    };
    for (const std::size_t row : rows_) {
      write_until(recording_.ticks[row].now_ns);
      write_tick(row);
    }
    write_until(std::numeric_limits<std::int64_t>::max());
    writer_.close();
  }

 private:
  void add_channels() {
    const std::string pose = R"({"type":"object","properties":{"position":)" + std::string(kVector) +
                             R"(,"orientation":)" + kQuaternion + "}}";
    const std::string text = kText;
    ticks_ = writer_.add_channel("/ticks", "wrenchd.Tick", tick_schema(fields_));
    transforms_ =
        writer_.add_channel("/tf", "foxglove.FrameTransform",
                            schema_of("foxglove.FrameTransform",
                                      R"("parent_frame_id":)" + text + R"(,"child_frame_id":)" + text +
                                          R"(,"translation":)" + kVector + R"(,"rotation":)" + kQuaternion));
    const std::string pose_schema =
        schema_of("foxglove.PoseInFrame", R"("frame_id":)" + text + R"(,"pose":)" + pose);
    commanded_ = writer_.add_channel("/pose/commanded", "foxglove.PoseInFrame", pose_schema);
    proxy_ = writer_.add_channel("/pose/proxy", "foxglove.PoseInFrame", pose_schema);
    const std::string wrench_schema = schema_of(
        "wrenchd.Wrench", R"("frame_id":)" + text + R"(,"force":)" + kVector + R"(,"torque":)" + kVector);
    wrench_out_ = writer_.add_channel("/wrench/out", "wrenchd.Wrench", wrench_schema);
    wrench_body_ = writer_.add_channel("/wrench/body", "wrenchd.Wrench", wrench_schema);
    events_ = writer_.add_channel(
        "/events", "foxglove.Log",
        schema_of("foxglove.Log", R"("level":{"type":"integer"},"message":)" + text + R"(,"name":)" + text +
                                      R"(,"file":)" + text + R"(,"line":{"type":"integer"})"));
    if (markers_.empty()) return;
    std::string properties = R"("marker":)" + text;
    for (const std::string& name : markers_.conditions())
      properties += "," + json_text(name) + R"(:{"type":["number","string","null"]})";
    conditions_ =
        writer_.add_channel("/conditions", "wrenchd.Conditions", schema_of("wrenchd.Conditions", properties));
  }

  void write(std::uint16_t channel, std::int64_t now_ns, const std::string& members) {
    writer_.add_message(channel, utc_.ns(now_ns), utc_.json(now_ns) + "," + members + "}");
  }

  void write_tick(std::size_t row) {
    const TickRecord& tick = recording_.ticks[row];
    std::string members = "\"time_s\":";
    append_number(members, time_s(recording_, row));
    for (std::size_t i = 0; i < fields_.size(); ++i) append_field(members, fields_[i], names_[i], tick);
    write(ticks_, tick.now_ns, members);
    write_transform(tick.now_ns, "world", "tool_commanded", tick.X_WP);
    write_transform(tick.now_ns, "world", "tool_proxy", tick.X_WQ);
    write_transform(tick.now_ns, "base", "handle", tick.X_BH);
    write_pose(commanded_, tick.now_ns, tick.X_WP);
    write_pose(proxy_, tick.now_ns, tick.X_WQ);
    write_wrench(wrench_out_, tick.now_ns, "base", tick.F_out);
    write_wrench(wrench_body_, tick.now_ns, "tool_commanded", tick.F_T);
  }

  static void append_value(std::string& to, const RecordField& field, const std::vector<std::string>& names,
                           const TickRecord& tick, std::size_t component) {
    if (field.type == FieldType::f64) return append_real(to, real_component(field, &tick, component));
    std::uint8_t number = 0;
    if (field.type == FieldType::u8)
      std::memcpy(&number, reinterpret_cast<const std::byte*>(&tick) + field.offset + component, 1);
    if (field.type == FieldType::u8 && !names.empty()) {
      to += json_text(number < names.size() ? names[number] : std::to_string(number));
      return;
    }
    append_component(to, field, &tick, component);
  }

  static void append_field(std::string& to, const RecordField& field, const std::vector<std::string>& names,
                           const TickRecord& tick) {
    to += ",\"" + std::string(field.name) + "\":";
    if (field.count == 1) return append_value(to, field, names, tick, 0);
    for (std::size_t i = 0; i < field.count; ++i) {
      to += (i == 0 ? "{\"" : ",\"") + component_suffix(field, i).substr(1) + "\":";
      append_value(to, field, names, tick, i);
    }
    to += '}';
  }

  void write_transform(std::int64_t now_ns, const char* parent, const char* child,
                       const TickRecord::PoseNumbers& pose) {
    if (!is_finite(pose)) return;
    std::string members = R"("parent_frame_id":")" + std::string(parent) + R"(","child_frame_id":")" + child +
                          R"(","translation":)";
    append_object(members, "xyz", pose.data());
    members += R"(,"rotation":)";
    append_object(members, "xyzw", pose.data() + 3);
    write(transforms_, now_ns, members);
  }

  void write_pose(std::uint16_t channel, std::int64_t now_ns, const TickRecord::PoseNumbers& pose) {
    if (!is_finite(pose)) return;
    std::string members = R"("frame_id":"world","pose":{"position":)";
    append_object(members, "xyz", pose.data());
    members += R"(,"orientation":)";
    append_object(members, "xyzw", pose.data() + 3);
    write(channel, now_ns, members + "}");
  }

  void write_wrench(std::uint16_t channel, std::int64_t now_ns, const char* frame,
                    const TickRecord::Numbers6& wrench) {
    std::string members = R"("frame_id":")" + std::string(frame) + R"(","force":)";
    append_object(members, "xyz", wrench.data());
    members += R"(,"torque":)";
    append_object(members, "xyz", wrench.data() + 3);
    write(channel, now_ns, members);
  }

  void write_event(const RecordedEvent& event) {
    constexpr int kLogInfo = 2;  // of foxglove.Log: 2 info, 3 warning, 4 error
    write(events_, event.time_ns,
          R"("level":)" + std::to_string(kLogInfo + static_cast<int>(event.severity)) + R"(,"message":)" +
              json_text(event.text) + R"(,"name":)" + json_text(event.name) + R"(,"file":"","line":0)");
  }

  void write_conditions(const MarkerColumns::Step& step) {
    std::string members = R"("marker":)" + json_text(step.label);
    for (std::size_t i = 0; i < step.values.size(); ++i)
      members += "," + json_text(markers_.conditions()[i]) + ":" + step.values[i].dump();
    write(conditions_, step.time_ns, members);
  }

  const Recording& recording_;
  std::vector<RecordField> fields_;
  std::vector<std::vector<std::string>> names_;
  std::vector<std::size_t> rows_;
  MarkerColumns markers_;
  UtcTime utc_;
  McapWriter writer_;
  std::uint16_t ticks_ = 0, transforms_ = 0, commanded_ = 0, proxy_ = 0, wrench_out_ = 0, wrench_body_ = 0,
                events_ = 0, conditions_ = 0;
};

}  // namespace

void write_mcap(std::ostream& out, const Recording& recording, const ExportSettings& settings) {
  McapExport(out, recording, settings).run();
}

}  // namespace wrenchd
