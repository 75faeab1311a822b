// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <string_view>
#include <utility>

#include <hdf5.h>

#include "daemon/recording/event_table.hpp"
#include "daemon/recording/h5_handle.hpp"
#include "daemon/recording/recording_reader.hpp"
#include "daemon/recording/recording_rows.hpp"
#include "daemon/servo/record_fields.hpp"

namespace wrenchd {
namespace {

/// Version of the columns and their meaning. A reader of another version rejects the file.
constexpr const char* kFormat = "9";
constexpr hsize_t kChunkContacts = 1024;
constexpr unsigned kDeflateLevel = 1;
/// Largest expansion of DEFLATE. A table that claims more rows than its file can hold is damaged.
constexpr std::uint64_t kMaxExpansion = 1032;
/// Maximum size of a mesh. The writer stores at most 32 MiB.
constexpr std::uint64_t kMaxMeshBytes = std::uint64_t{1} << 28;
/// Maximum size of a text. Configuration files have at most 1 MiB.
constexpr std::size_t kMaxTextBytes = std::size_t{64} << 20;
constexpr hsize_t kMaxChunkBytes = hsize_t{64} << 20;
constexpr std::size_t kMaxNames = 10'000;
/// Rows that are read and sent together.
constexpr hsize_t kPieceRows = 4 * RecordingWriter::kChunkTicks;

/// Columns of /ticks that a recording of this format may lack, because it is older. Their values are zeros
/// then.
constexpr std::array<std::string_view, 6> kLaterFields = {
    "X_WB",       "requested_external", "external_energy_J", "external_expires_ns",
    "F_external", "external_balance_J"};

constexpr std::array kContactRangeFields = {
    RecordField{"first_contact", FieldType::u64, 1, offsetof(TickRow, first_contact), "1", "",
                "row of /contacts with the first contact of the tick", ValueNames::none},
    RecordField{
        "contact_count", FieldType::u32, 1, offsetof(TickRow, contact_count), "1", "",
        "rows of /contacts for the tick, at most 16 with the largest multipliers; `contacts` counts all",
        ValueNames::none},
};

/// Description of one of the two tables.
struct TableKind {
  const char* path;
  const char* name;  ///< Name in messages and in /fields.
  std::size_t row_bytes;
  std::vector<RecordField> fields;
  hsize_t chunk_rows;
};

const TableKind& tick_table() {
  static const TableKind kind = [] {
    const auto fields = tick_fields();
    TableKind made{
        "/ticks", "ticks", sizeof(TickRow), {fields.begin(), fields.end()}, RecordingWriter::kChunkTicks};
    made.fields.insert(made.fields.end(), kContactRangeFields.begin(), kContactRangeFields.end());
    return made;
  }();
  return kind;
}

const TableKind& contact_table() {
  static const TableKind kind = [] {
    const auto fields = contact_fields();
    TableKind made{"/contacts", "contacts", sizeof(Touch), {}, kChunkContacts};
    for (const RecordField& field : fields)
      if (std::string(field.name) != "padding") made.fields.push_back(field);
    return made;
  }();
  return kind;
}

hid_t type_of(FieldType type) {
  switch (type) {
    case FieldType::u8:
      return H5T_NATIVE_UINT8;
    case FieldType::u16:
      return H5T_NATIVE_UINT16;
    case FieldType::u32:
      return H5T_NATIVE_UINT32;
    case FieldType::u64:
      return H5T_NATIVE_UINT64;
    case FieldType::i64:
      return H5T_NATIVE_INT64;
    case FieldType::f64:
      break;
  }
  return H5T_NATIVE_DOUBLE;
}

using Handle = H5Handle;

/// Stops HDF5 from printing its error stack. RecordingError carries the message instead. The exit handler of
/// HDF5 is off: it tries to close a file again that a full disk did not let it close, and crashes.
void set_up_hdf5() {
  [[maybe_unused]] static const herr_t first_call = H5dont_atexit();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

hid_t row_type(const TableKind& table) {
  const hid_t row = H5Tcreate(H5T_COMPOUND, table.row_bytes);
  for (const RecordField& field : table.fields) {
    if (field.count == 1) {
      H5Tinsert(row, field.name, field.offset, type_of(field.type));
      continue;
    }
    const hsize_t count = field.count;
    const Handle array(H5Tarray_create2(type_of(field.type), 1, &count), H5Tclose);
    H5Tinsert(row, field.name, field.offset, array);
  }
  return row;
}

// ------------------------------------------------------------------------------------------------ Writing

hid_t text_type(std::size_t bytes) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(bytes, 1));
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

/// Uses a type of variable length, because Python reads texts of fixed length as bytes.
void write_text(hid_t object, const char* name, const std::string& text) {
  const Handle type(text_type(H5T_VARIABLE), H5Tclose);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const char* const bytes = text.c_str();
  H5Awrite(attribute, type, &bytes);
}

void write_number(hid_t object, const char* name, hid_t type, const void* number) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  H5Awrite(attribute, type, number);
}

std::string values_of(const RecordField& field) {
  std::string text;
  for (const std::string& name : value_names(field.values)) text += (text.empty() ? "" : ", ") + name;
  if (!text.empty()) text = (is_bits(field.values) ? "bits from the lowest: " : "from 0: ") + text;
  return text;
}

hid_t create_table(hid_t file, const TableKind& table, hid_t row) {
  const hsize_t none = 0;
  const hsize_t unlimited = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &none, &unlimited), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(layout, 1, &table.chunk_rows);
  H5Pset_shuffle(layout);
  H5Pset_deflate(layout, kDeflateLevel);
  const hid_t made = H5Dcreate2(file, table.path, row, space, H5P_DEFAULT, layout, H5P_DEFAULT);
  if (made < 0) return made;
  for (const RecordField& field : table.fields) {
    const std::string column = field.name;
    write_text(made, (column + ".unit").c_str(), field.unit);
    if (*field.frame != '\0') write_text(made, (column + ".frame").c_str(), field.frame);
    write_text(made, (column + ".doc").c_str(), field.doc);
    if (const std::string values = values_of(field); !values.empty())
      write_text(made, (column + ".values").c_str(), values);
  }
  return made;
}

/// A row of /fields, which repeats the attributes of all columns as a table.
struct FieldRow {
  const char *table, *name, *type;
  std::uint32_t count;
  const char *unit, *frame, *doc, *values;
};

void write_fields(hid_t file) {
  std::vector<std::string> values;
  std::vector<FieldRow> rows;
  std::size_t all = 0;
  for (const TableKind* table : {&tick_table(), &contact_table()}) all += table->fields.size();
  values.reserve(all);  // no reallocation, because rows point to the elements
  for (const TableKind* table : {&tick_table(), &contact_table()})
    for (const RecordField& field : table->fields) {
      values.push_back(values_of(field));
      rows.push_back({table->name, field.name, name(field.type), field.count, field.unit, field.frame,
                      field.doc, values.back().c_str()});
    }
  for (const EventColumn& column : event_columns())
    rows.push_back({"events", column.name, column.type, 1, column.unit, "", column.doc, column.values});
  const Handle text(text_type(H5T_VARIABLE), H5Tclose);
  const Handle type(H5Tcreate(H5T_COMPOUND, sizeof(FieldRow)), H5Tclose);
  H5Tinsert(type, "table", offsetof(FieldRow, table), text);
  H5Tinsert(type, "name", offsetof(FieldRow, name), text);
  H5Tinsert(type, "type", offsetof(FieldRow, type), text);
  H5Tinsert(type, "count", offsetof(FieldRow, count), H5T_NATIVE_UINT32);
  H5Tinsert(type, "unit", offsetof(FieldRow, unit), text);
  H5Tinsert(type, "frame", offsetof(FieldRow, frame), text);
  H5Tinsert(type, "doc", offsetof(FieldRow, doc), text);
  H5Tinsert(type, "values", offsetof(FieldRow, values), text);
  const hsize_t count = rows.size();
  const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const Handle made(H5Dcreate2(file, "/fields", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                    H5Dclose);
  H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data());
}

void describe_events(hid_t set) {
  for (const EventColumn& column : event_columns()) {
    const std::string name = column.name;
    write_text(set, (name + ".unit").c_str(), column.unit);
    write_text(set, (name + ".doc").c_str(), column.doc);
    if (*column.values != '\0') write_text(set, (name + ".values").c_str(), column.values);
  }
}

/// Writes the text of a configuration file, with its path as an attribute.
void write_config(hid_t group, const std::string& name, const std::filesystem::path& path,
                  const std::string& text) {
  const Handle type(text_type(text.size()), H5Tclose);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle made(H5Dcreate2(group, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                    H5Dclose);
  H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.c_str());
  write_text(made, "file", path.string());
}

void write_mesh(hid_t group, const RecordedFile& mesh) {
  constexpr hsize_t kMeshChunk = hsize_t{1} << 16;
  const hsize_t count = mesh.embedded ? mesh.bytes.size() : 0;
  const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  if (count > 0) {
    const hsize_t chunk = std::min(count, kMeshChunk);
    H5Pset_chunk(layout, 1, &chunk);
    H5Pset_deflate(layout, kDeflateLevel);
  }
  const Handle made(
      H5Dcreate2(group, mesh.role.c_str(), H5T_NATIVE_UINT8, space, H5P_DEFAULT, layout, H5P_DEFAULT),
      H5Dclose);
  if (count > 0) H5Dwrite(made, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, mesh.bytes.data());
  write_text(made, "file", mesh.path.string());
  write_text(made, "sha256", mesh.sha256);
  const std::uint8_t embedded = mesh.embedded ? 1 : 0;
  write_number(made, "embedded", H5T_NATIVE_UINT8, &embedded);
}

bool is_mesh(const std::string& role) {
  return role == "tool" || role.starts_with("obstacle_") || role.starts_with("body_");
}

std::string utc(std::int64_t unix_ns) {
  const std::time_t whole_s = unix_ns / 1'000'000'000;
  std::tm parts{};
  gmtime_r(&whole_s, &parts);
  std::array<char, 40> day{};
  const std::size_t length = std::strftime(day.data(), day.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::string us = std::to_string(unix_ns / 1000 % 1'000'000);
  us.insert(0, 6 - std::min<std::size_t>(us.size(), 6), '0');
  return std::string(day.data(), length) + "." + us + "Z";
}

void write_header(hid_t file, const RecordingHeader& header) {
  write_text(file, "format", kFormat);
  write_text(file, "wrenchd_version", header.version);
  write_text(file, "kernel", header.kernel);
  write_text(file, "realtime", header.realtime);
  write_text(file, "clock", header.virtual_time ? "virtual" : "CLOCK_MONOTONIC");
  write_number(file, "rate_Hz", H5T_NATIVE_DOUBLE, &header.rate_Hz);
  if (header.hands > 1) {
    write_number(file, "hands", H5T_NATIVE_INT, &header.hands);
    write_text(file, "hand", header.hand);
  }
  write_text(file, "started_utc", utc(header.started_unix_ns));
  write_number(file, "started_unix_ns", H5T_NATIVE_INT64, &header.started_unix_ns);
  write_number(file, "started_ns", H5T_NATIVE_INT64, &header.started_ns);
  write_text(file, "time", "UTC of a tick in ns since 1970: started_unix_ns + (now_ns - started_ns)");
  const Handle config(H5Gcreate2(file, "/config", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  write_config(config, "settings", header.settings_file, header.settings);
  write_config(config, "scene", header.scene_file, header.scene);
  write_config(config, "profile", header.profile_file, header.profile);
  const Handle meshes(H5Gcreate2(file, "/meshes", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  for (const RecordedFile& one : header.files) {
    if (is_mesh(one.role))
      write_mesh(meshes, one);
    else
      write_config(config, one.role, one.path, one.bytes);
  }
}

}  // namespace

void RecordBatch::clear() {
  ticks.clear();
  contact_ranges.clear();
  contacts.clear();
}

void RecordBatch::add(const TickRecord& tick, std::span<const Touch> tick_contacts) {
  ticks.push_back(tick);
  contact_ranges.push_back({contacts.size(), static_cast<std::uint32_t>(tick_contacts.size())});
  contacts.insert(contacts.end(), tick_contacts.begin(), tick_contacts.end());
}

struct RecordingWriter::File {
  std::filesystem::path path;
  Handle file;
  Handle tick_row;
  Handle contact_row;
  Handle ticks;
  Handle contacts;
  EventTable events;
  hsize_t tick_rows = 0;
  hsize_t contact_rows = 0;
  std::vector<TickRow> rows = {};

  void append(const Handle& table, const Handle& row, hsize_t& rows_so_far, const void* from, hsize_t count) {
    if (count == 0) return;
    const hsize_t start = rows_so_far;
    const hsize_t total = start + count;
    const bool grown = H5Dset_extent(table, &total) >= 0;
    const Handle in_file(H5Dget_space(table), H5Sclose);
    H5Sselect_hyperslab(in_file, H5S_SELECT_SET, &start, nullptr, &count, nullptr);
    const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    if (!grown || H5Dwrite(table, row, in_memory, in_file, H5P_DEFAULT, from) < 0) fail();
    rows_so_far = total;
  }
  [[noreturn]] void fail() const {
    throw RecordingError(path.string() +
                         ": the recording cannot be written; check that the disk is connected and not full");
  }
};

RecordingWriter::RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header) {
  set_up_hdf5();
  std::error_code ignored;
  if (std::filesystem::exists(std::filesystem::symlink_status(file, ignored)))
    throw RecordingError(file.string() +
                         ": already exists, and wrenchd never overwrites a recording; choose another name");
  const hid_t id = H5Fcreate(file.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT);
  if (id < 0)
    throw RecordingError(file.string() +
                         ": cannot be created; check that the directory exists and is writable");
  const hid_t tick_row = row_type(tick_table());
  const hid_t contact_row = row_type(contact_table());
  file_.reset(new File{file, Handle(id, H5Fclose), Handle(tick_row, H5Tclose), Handle(contact_row, H5Tclose),
                       Handle(create_table(id, tick_table(), tick_row), H5Dclose),
                       Handle(create_table(id, contact_table(), contact_row), H5Dclose), EventTable(id)});
  if (!file_->ticks.ok() || !file_->contacts.ok() || !file_->events.ok())
    throw RecordingError(file.string() + ": the tables cannot be created; check that the disk is not full");
  describe_events(file_->events.set());
  write_fields(id);
  write_header(id, header);
  flush();
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::append(std::span<const TickRecord> records) {
  append(records, {}, {});
}

/// Passes the contacts to the operating system first, so that a row of /ticks never refers to a row of
/// /contacts that is missing, whenever the disk is full or the process dies.
void RecordingWriter::append(std::span<const TickRecord> ticks, std::span<const ContactRange> ranges,
                             std::span<const Touch> contacts) {
  const hsize_t first = file_->contact_rows;
  file_->rows.assign(ticks.size(), TickRow{});
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    file_->rows[i].tick = ticks[i];
    file_->rows[i].first_contact = first;
    if (ranges.empty()) continue;
    file_->rows[i].first_contact = first + ranges[i].first;
    file_->rows[i].contact_count = ranges[i].count;
  }
  file_->append(file_->contacts, file_->contact_row, file_->contact_rows, contacts.data(), contacts.size());
  // The whole file is flushed, because its recorded end must include the new rows: H5Dflush() would leave
  // them beyond the end until the next flush() of the file.
  if (!contacts.empty()) flush();
  file_->append(file_->ticks, file_->tick_row, file_->tick_rows, file_->rows.data(), ticks.size());
}

void RecordingWriter::append_events(std::span<const RecordedEvent> events) {
  if (!file_->events.append(events)) file_->fail();
}

void RecordingWriter::flush() {
  if (H5Fflush(file_->file, H5F_SCOPE_LOCAL) < 0) file_->fail();
}

// ------------------------------------------------------------------------------------------------ Reading
//
// This part runs in the child process of read_recording(). It asks libhdf5 about each object before it reads
// the object, and rejects what RecordingWriter never writes.

namespace {

[[noreturn]] void reject(const std::string& reason) {
  throw RecordingError(reason);
}

/// Returns the text of an attribute or data set; returns an empty text if there is none.
template <class Read>
std::string text_of(const Handle& type, const Read& read) {
  if (!type.ok() || H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) return {};
  const std::size_t size = H5Tget_size(type);
  if (size > kMaxTextBytes) reject("has a text of more than 64 MiB; the file is damaged");
  std::string text(size, '\0');
  if (read(text.data()) < 0) return {};
  text.resize(std::min(text.size(), text.find('\0')));  // an empty text is stored as one zero byte
  return text;
}

std::string read_text(hid_t object, const char* name) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return {};
  const Handle space(H5Aget_space(attribute), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  const Handle type(H5Aget_type(attribute), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0)
    return text_of(type, [&](char* to) { return H5Aread(attribute, type, to); });
  char* bytes = nullptr;
  if (H5Aread(attribute, type, &bytes) < 0 || bytes == nullptr) return {};
  const std::string text(bytes, ::strnlen(bytes, kMaxTextBytes));
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, &bytes);
  return text;
}

template <class T>
T read_number(hid_t object, const char* name, hid_t type, T otherwise) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return otherwise;
  const Handle space(H5Aget_space(attribute), H5Sclose);
  const Handle stored(H5Aget_type(attribute), H5Tclose);
  const H5T_class_t kind = H5Tget_class(stored);
  T number = otherwise;
  if (H5Sget_simple_extent_npoints(space) != 1 || (kind != H5T_INTEGER && kind != H5T_FLOAT) ||
      H5Aread(attribute, type, &number) < 0)
    return otherwise;
  return number;
}

/// Rejects a name that does not stand for an object of this file: a soft link may form a loop, and an
/// external link opens another file. Returns false if the name does not exist.
bool is_object(hid_t group, const std::string& name) {
  if (H5Lexists(group, name.c_str(), H5P_DEFAULT) <= 0) return false;
  H5L_info_t link{};
  if (H5Lget_info(group, name.c_str(), &link, H5P_DEFAULT) < 0)
    reject("'" + name + "' cannot be read; the file is damaged");
  if (link.type != H5L_TYPE_HARD)
    reject("'" + name + "' is a " + (link.type == H5L_TYPE_SOFT ? "symbolic link" : "link to another file") +
           ", and a recording has none; use a complete copy, as it was recorded");
  return true;
}

/// Rejects a data set whose bytes are not all in this file, or need a plug-in of libhdf5.
void check_storage(hid_t set, const std::string& name) {
  const Handle plan(H5Dget_create_plist(set), H5Pclose);
  if (!plan.ok()) reject("'" + name + "' cannot be read; the file is damaged");
  const std::string own =
      ", and a recording contains all of its data itself; use a complete copy, as it was recorded";
  const H5D_layout_t layout = H5Pget_layout(plan);
  if (H5Pget_external_count(plan) != 0)
    reject("'" + name + "' takes its data from another file (external storage)" + own);
  if (layout != H5D_CHUNKED && layout != H5D_CONTIGUOUS && layout != H5D_COMPACT)
    reject("'" + name + "' takes its data from other data sets (virtual storage)" + own);
  const int filters = H5Pget_nfilters(plan);
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(plan, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, &config);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_FLETCHER32)
      reject("'" + name + "' is compressed in a way that no recording is; the file is damaged");
  }
  if (layout != H5D_CHUNKED) return;
  std::array<hsize_t, 1> chunk{};
  const Handle type(H5Dget_type(set), H5Tclose);
  if (H5Pget_chunk(plan, static_cast<int>(chunk.size()), chunk.data()) != 1 ||
      chunk[0] > kMaxChunkBytes / std::max<std::size_t>(1, H5Tget_size(type)))
    reject("'" + name + "' has blocks of more than 64 MiB; the file is damaged");
}

/// Opens a data set of a group. Returns no handle if there is none of this name.
hid_t open_set(hid_t group, const std::string& name) {
  if (!is_object(group, name)) return H5I_INVALID_HID;
  const hid_t object = H5Oopen(group, name.c_str(), H5P_DEFAULT);
  if (object < 0 || H5Iget_type(object) != H5I_DATASET) {
    if (object >= 0) H5Oclose(object);
    reject("'" + name + "' is no table and no text; the file is damaged");
  }
  try {
    check_storage(object, name);
  } catch (...) {
    H5Oclose(object);
    throw;
  }
  return object;
}

std::string read_config(hid_t set, std::filesystem::path& path) {
  const Handle space(H5Dget_space(set), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  const Handle type(H5Dget_type(set), H5Tclose);
  path = read_text(set, "file");
  return text_of(type, [&](char* to) { return H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, to); });
}

std::vector<std::string> names_in(hid_t group) {
  std::vector<std::string> names;
  H5Literate(
      group, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr,
      [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
        auto& all = *static_cast<std::vector<std::string>*>(list);
        if (all.size() >= kMaxNames) return -1;
        all.emplace_back(name);
        return 0;
      },
      &names);
  if (names.size() >= kMaxNames) reject("has more than 10000 files; the file is damaged");
  return names;
}

RecordedFile read_mesh(hid_t set, const std::string& role, std::uint64_t file_bytes) {
  RecordedFile mesh{role,
                    read_text(set, "file"),
                    read_text(set, "sha256"),
                    read_number<std::uint8_t>(set, "embedded", H5T_NATIVE_UINT8, 0) != 0,
                    {}};
  const Handle space(H5Dget_space(set), H5Sclose);
  const Handle type(H5Dget_type(set), H5Tclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (!mesh.embedded || count <= 0) return mesh;
  if (H5Tget_class(type) != H5T_INTEGER || H5Tget_size(type) != 1)
    reject("the mesh '" + role + "' does not consist of bytes; the file is damaged");
  if (static_cast<std::uint64_t>(count) > std::min<std::uint64_t>(kMaxMeshBytes, file_bytes * kMaxExpansion))
    reject("the mesh '" + role + "' claims more bytes than the file can hold; the file is damaged");
  mesh.bytes.resize(static_cast<std::size_t>(count));
  if (H5Dread(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, mesh.bytes.data()) < 0)
    reject("the mesh '" + role + "' cannot be read; the file is damaged");
  return mesh;
}

void read_files(hid_t file, std::uint64_t file_bytes, RecordingHeader& header) {
  for (const char* group_name : {"config", "meshes"}) {
    if (!is_object(file, group_name)) continue;
    const Handle group(H5Gopen2(file, group_name, H5P_DEFAULT), H5Gclose);
    if (!group.ok()) continue;
    for (const std::string& name : names_in(group)) {
      const Handle set(open_set(group, name), H5Dclose);
      if (!set.ok()) continue;
      if (is_mesh(name)) {
        header.files.push_back(read_mesh(set, name, file_bytes));
        continue;
      }
      std::filesystem::path path;
      std::string text = read_config(set, path);
      if (name == "settings")
        header.settings = text, header.settings_file = path;
      else if (name == "scene")
        header.scene = text, header.scene_file = path;
      else if (name == "profile")
        header.profile = text, header.profile_file = path;
      else
        header.files.push_back({name, path, {}, true, text});
    }
  }
}

RecordingHeader read_header(hid_t file, std::uint64_t file_bytes) {
  RecordingHeader header;
  header.version = read_text(file, "wrenchd_version");
  header.kernel = read_text(file, "kernel");
  header.realtime = read_text(file, "realtime");
  header.virtual_time = read_text(file, "clock") == "virtual";
  header.rate_Hz = read_number(file, "rate_Hz", H5T_NATIVE_DOUBLE, 0.0);
  header.hands = read_number<int>(file, "hands", H5T_NATIVE_INT, 1);
  header.hand = read_text(file, "hand");
  header.started_ns = read_number<std::int64_t>(file, "started_ns", H5T_NATIVE_INT64, 0);
  header.started_unix_ns = read_number<std::int64_t>(file, "started_unix_ns", H5T_NATIVE_INT64, 0);
  read_files(file, file_bytes, header);
  return header;
}

/// Rejects a file of another format before anything is read, because its columns differ in name or meaning.
void check_format(hid_t file) {
  std::string format = read_text(file, "format");
  std::string version = read_text(file, "wrenchd_version");
  if (format.empty()) {  // formats up to 5 have these attributes at the table
    const Handle table(open_set(file, "ticks"), H5Dclose);
    if (!table.ok()) reject("has no table 'ticks'; name a recording of wrenchd");
    format = read_text(table, "format");
    version = read_text(table, "wrenchd_version");
    if (format.empty()) format = "1";
  }
  if (format != kFormat)
    reject("was written by wrenchd " + (version.empty() ? "of an unknown version" : version) +
           " in recording format " + format + ", and this wrenchd reads format " + kFormat +
           "; replay or export it with the version that wrote it");
}

bool is_number(H5T_class_t kind) {
  return kind == H5T_INTEGER || kind == H5T_FLOAT;
}

/// Rejects a table that lacks a column, or has a column of another type.
void check_columns(const TableKind& table, hid_t set) {
  const Handle type(H5Dget_type(set), H5Tclose);
  if (H5Tget_class(type) != H5T_COMPOUND)
    reject("table '" + std::string(table.name) + "' has no columns; name a recording of wrenchd");
  if (H5Tget_size(type) > 4 * table.row_bytes)
    reject("table '" + std::string(table.name) + "' has longer rows than a recording; the file is damaged");
  for (const RecordField& field : table.fields) {
    const int index = H5Tget_member_index(type, field.name);
    const std::string column = "column '" + std::string(field.name) + "' of table '" + table.name + "' ";
    const bool later = std::find(kLaterFields.begin(), kLaterFields.end(), field.name) != kLaterFields.end();
    if (index < 0 && later) continue;
    if (index < 0) reject(column + "is missing; the file was changed, take it as it was recorded");
    const Handle member(H5Tget_member_type(type, static_cast<unsigned>(index)), H5Tclose);
    const H5T_class_t kind = H5Tget_class(member);
    bool good = field.count == 1 && is_number(kind) && H5Tget_size(member) == size_of(field.type);
    if (field.count > 1 && kind == H5T_ARRAY) {
      std::array<hsize_t, 1> count{};
      const Handle element(H5Tget_super(member), H5Tclose);
      good = H5Tget_array_ndims(member) == 1 && H5Tget_array_dims2(member, count.data()) == 1 &&
             count[0] == field.count && is_number(H5Tget_class(element)) &&
             H5Tget_size(element) == size_of(field.type);
    }
    if (!good)
      reject(column +
             "has another type than in a recording; the file was changed, take it as it was recorded");
  }
}

/// Sends the rows of a table in pieces, so that the address space need not hold it.
template <class Row>
void send_table(hid_t file, std::uint64_t file_bytes, const TableKind& table, RecordingSender& sender) {
  const Handle set(open_set(file, table.path + 1), H5Dclose);
  if (!set.ok()) reject("has no table '" + std::string(table.name) + "'; name a recording of wrenchd");
  check_columns(table, set);
  const Handle space(H5Dget_space(set), H5Sclose);
  hsize_t rows = 0;
  if (H5Sget_simple_extent_ndims(space) != 1 || H5Sget_simple_extent_dims(space, &rows, nullptr) != 1)
    reject("table '" + std::string(table.name) + "' is not one-dimensional; the file is damaged");
  if (rows > file_bytes * kMaxExpansion / table.row_bytes + 1)
    reject("table '" + std::string(table.name) + "' cannot have the " + std::to_string(rows) +
           " rows that its header states; the file is damaged");
  const Handle row(row_type(table), H5Tclose);
  std::vector<Row> piece(static_cast<std::size_t>(std::min<hsize_t>(rows, kPieceRows)));
  for (hsize_t start = 0; start < rows; start += kPieceRows) {
    const hsize_t count = std::min<hsize_t>(kPieceRows, rows - start);
    const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    H5Sselect_hyperslab(space, H5S_SELECT_SET, &start, nullptr, &count, nullptr);
    std::fill(piece.begin(), piece.end(), Row{});
    if (H5Dread(set, row, in_memory, space, H5P_DEFAULT, piece.data()) < 0)
      reject("table '" + std::string(table.name) + "' cannot be read; the file is damaged or truncated");
    sender.send(std::span(std::as_const(piece)).first(static_cast<std::size_t>(count)));
  }
}

void send_events(hid_t file, std::uint64_t file_bytes, RecordingSender& sender) {
  const Handle set(open_set(file, "events"), H5Dclose);
  if (!set.ok()) reject("has no table 'events'; name a recording of wrenchd");
  const EventsRead events = read_events(set, file_bytes * kMaxExpansion / event_row_bytes() + 1);
  if (events.error != nullptr) reject(std::string("table 'events' ") + events.error);
  sender.send(events.events);
}

}  // namespace

void send_hdf5(int descriptor, std::uint64_t file_bytes, const std::function<void()>& open_done,
               RecordingSender& sender) {
  set_up_hdf5();
  H5PLset_loading_state(0);  // no plug-ins, whatever the file or the environment names
  const std::string name = "/proc/self/fd/" + std::to_string(descriptor);
  const Handle file(H5Fopen(name.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok())
    reject(H5Fis_hdf5(name.c_str()) > 0 ? "is truncated or damaged; use a complete copy"
                                        : "is not an HDF5 file; name a recording of wrenchd");
  open_done();
  check_format(file);
  sender.send(read_header(file, file_bytes));
  send_table<TickRow>(file, file_bytes, tick_table(), sender);
  send_table<Touch>(file, file_bytes, contact_table(), sender);
  send_events(file, file_bytes, sender);
  sender.end();
}

}  // namespace wrenchd
