// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/event_table.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include <hdf5.h>

namespace wrenchd {
namespace {

static_assert(std::is_same_v<hid_t, std::int64_t> && std::is_same_v<herr_t, int>,
              "as h5_handle.hpp has them");

constexpr const char* kPath = "/events";
constexpr hsize_t kChunkRows = 32;
constexpr unsigned kEventDeflateLevel = 1;

/// A row of /events. A text ends at its first zero byte or at its last byte.
struct StoredEvent {
  std::int64_t time_ns = 0;
  std::int64_t tick = 0;
  double value = 0.0;
  std::uint8_t severity = 0;
  std::array<char, RecordedEvent::kNameBytes> name{};
  std::array<char, RecordedEvent::kTextBytes> text{};
  std::array<char, RecordedEvent::kConditionsBytes> conditions{};
};
static_assert(std::is_trivially_copyable_v<StoredEvent>);

constexpr std::array<EventColumn, 7> kColumns = {{
    {"time_ns", "i64", "ns", "time of the event, on the clock of now_ns", ""},
    {"tick", "i64", "1", "number of the tick in progress; -1 if no tick was stored at that time", ""},
    {"severity", "u8", "enum", "severity of the event", "from 0: info, warning, error"},
    {"name", "text", "1", "kind of the event; 'marker' is a marker of an experiment", ""},
    {"text", "text", "1", "the event for people; the label of a marker", ""},
    {"value", "f64", "SI",
     "size of a fault, scale of the stiffness, distance of the proxy in m, or number of the rendering; NaN "
     "if "
     "the event has no number",
     ""},
    {"conditions", "text", "JSON", "conditions of a marker, which hold until the next marker changes them",
     ""},
}};

hid_t text_member(std::size_t bytes) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, bytes);
  H5Tset_cset(type, H5T_CSET_UTF8);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return type;
}

hid_t event_row_type() {
  const hid_t row = H5Tcreate(H5T_COMPOUND, sizeof(StoredEvent));
  H5Tinsert(row, "time_ns", offsetof(StoredEvent, time_ns), H5T_NATIVE_INT64);
  H5Tinsert(row, "tick", offsetof(StoredEvent, tick), H5T_NATIVE_INT64);
  H5Tinsert(row, "severity", offsetof(StoredEvent, severity), H5T_NATIVE_UINT8);
  const H5Handle name(text_member(RecordedEvent::kNameBytes), H5Tclose);
  H5Tinsert(row, "name", offsetof(StoredEvent, name), name);
  const H5Handle text(text_member(RecordedEvent::kTextBytes), H5Tclose);
  H5Tinsert(row, "text", offsetof(StoredEvent, text), text);
  H5Tinsert(row, "value", offsetof(StoredEvent, value), H5T_NATIVE_DOUBLE);
  const H5Handle conditions(text_member(RecordedEvent::kConditionsBytes), H5Tclose);
  H5Tinsert(row, "conditions", offsetof(StoredEvent, conditions), conditions);
  return row;
}

hid_t create_set(hid_t file, hid_t row) {
  const hsize_t none = 0, unlimited = H5S_UNLIMITED;
  const H5Handle space(H5Screate_simple(1, &none, &unlimited), H5Sclose);
  const H5Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(layout, 1, &kChunkRows);
  H5Pset_deflate(layout, kEventDeflateLevel);
  return H5Dcreate2(file, kPath, row, space, H5P_DEFAULT, layout, H5P_DEFAULT);
}

template <std::size_t N>
void put(std::array<char, N>& to, const std::string& text) {
  const std::string cut = cut_text(text, N);
  std::copy(cut.begin(), cut.end(), to.begin());
}

template <std::size_t N>
std::string get(const std::array<char, N>& from) {
  return std::string(from.begin(), std::find(from.begin(), from.end(), '\0'));
}

StoredEvent to_row(const RecordedEvent& event) {
  StoredEvent row;
  std::memset(static_cast<void*>(&row), 0, sizeof row);  // padding too: equal events have equal bytes
  row.time_ns = event.time_ns;
  row.tick = event.tick;
  row.value = event.value;
  row.severity = static_cast<std::uint8_t>(event.severity);
  put(row.name, event.name);
  put(row.text, event.text);
  // A JSON object that is cut has no meaning.
  if (event.conditions.size() <= RecordedEvent::kConditionsBytes) put(row.conditions, event.conditions);
  return row;
}

RecordedEvent from_row(const StoredEvent& row) {
  constexpr auto kHighest = static_cast<std::uint8_t>(EventLevel::error);
  return {row.time_ns,        row.tick,      static_cast<EventLevel>(std::min(row.severity, kHighest)),
          get(row.name),      get(row.text), row.value,
          get(row.conditions)};
}

}  // namespace

std::string cut_text(std::string_view text, std::size_t max_bytes) {
  if (text.size() <= max_bytes) return std::string(text);
  std::size_t end = max_bytes;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  return std::string(text.substr(0, end));
}

std::span<const EventColumn> event_columns() noexcept {
  return kColumns;
}

std::size_t event_row_bytes() noexcept {
  return sizeof(StoredEvent);
}

EventTable::EventTable(hid_t file)
    : row_(event_row_type(), H5Tclose), set_(create_set(file, row_), H5Dclose) {}

bool EventTable::append(std::span<const RecordedEvent> events) {
  if (events.empty()) return true;
  std::vector<StoredEvent> rows;
  rows.reserve(events.size());
  for (const RecordedEvent& event : events) rows.push_back(to_row(event));
  const hsize_t start = rows_, count = rows.size(), total = start + count;
  if (H5Dset_extent(set_, &total) < 0) return false;
  const H5Handle in_file(H5Dget_space(set_), H5Sclose);
  H5Sselect_hyperslab(in_file, H5S_SELECT_SET, &start, nullptr, &count, nullptr);
  const H5Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
  if (H5Dwrite(set_, row_, in_memory, in_file, H5P_DEFAULT, rows.data()) < 0) return false;
  rows_ = total;
  return true;
}

EventsRead read_events(hid_t set, std::uint64_t most_rows) {
  const H5Handle stored(H5Dget_type(set), H5Tclose);
  if (H5Tget_class(stored) != H5T_COMPOUND) return {{}, "has no columns; name a recording of wrenchd"};
  if (H5Tget_size(stored) > 4 * sizeof(StoredEvent))
    return {{}, "has longer rows than a recording; the file is damaged"};
  for (const EventColumn& column : kColumns) {
    const int member = H5Tget_member_index(stored, column.name);
    if (member < 0) return {{}, "lacks a column; the file was changed, take it as it was recorded"};
    const H5Handle type(H5Tget_member_type(stored, static_cast<unsigned>(member)), H5Tclose);
    const bool is_text = std::strcmp(column.type, "text") == 0;
    if ((H5Tget_class(type) == H5T_STRING) != is_text || (is_text && H5Tis_variable_str(type) > 0))
      return {{}, "has a column of another type; the file was changed, take it as it was recorded"};
  }
  const H5Handle space(H5Dget_space(set), H5Sclose);
  hsize_t count = 0;
  if (H5Sget_simple_extent_ndims(space) != 1 || H5Sget_simple_extent_dims(space, &count, nullptr) != 1)
    return {{}, "is not one-dimensional; the file is damaged"};
  if (count > most_rows) return {{}, "cannot have as many rows as its header states; the file is damaged"};
  std::vector<StoredEvent> rows(count);
  const H5Handle row(event_row_type(), H5Tclose);
  if (count > 0 && H5Dread(set, row, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()) < 0)
    return {{}, "cannot be read; the file is damaged or truncated"};
  while (!rows.empty() && rows.back().name[0] == '\0') rows.pop_back();
  EventsRead read;
  read.events.reserve(rows.size());
  for (const StoredEvent& one : rows) read.events.push_back(from_row(one));
  return read;
}

}  // namespace wrenchd
