// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <ctime>

#include <hdf5.h>

#include "daemon/recording/recording_stream.hpp"
#include "daemon/recording/recording_tables.hpp"

namespace wrenchd {
namespace {

/// Version of the columns and their meaning. A reader of another version rejects the file.
constexpr const char* kFormat = "7";
constexpr unsigned kDeflateLevel = 1;
/// Largest expansion of DEFLATE. A table that claims more rows than its file can hold is damaged.
constexpr std::uint64_t kMaxExpansion = 1032;
/// Maximum size of a text or a mesh.
constexpr hsize_t kMaxBytes = hsize_t{1} << 31;
/// Rows of a table that are read together.
constexpr hsize_t kReadRows = 4096;

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

/// Owns an HDF5 identifier.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): HDF5 takes plain identifiers
  bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  Close close_;
};

/// Stops HDF5 from printing its error stack. RecordingError carries the message instead.
void silence_hdf5() {
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
  const hsize_t chunk_rows = table.chunk_rows;
  H5Pset_chunk(layout, 1, &chunk_rows);
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
  return role == "tool" || role.starts_with("obstacle_");
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
  void flush() const {
    if (H5Fflush(file, H5F_SCOPE_LOCAL) < 0) fail();
  }
  [[noreturn]] void fail() const {
    throw RecordingError(path.string() +
                         ": the recording cannot be written; check that the disk is connected and not full");
  }
};

std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

void initialize_hdf5() {
  H5open();
}

RecordingWriter::RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header) {
  const std::scoped_lock lock(hdf5_mutex());
  silence_hdf5();
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
                       Handle(create_table(id, contact_table(), contact_row), H5Dclose)});
  if (!file_->ticks.ok() || !file_->contacts.ok())
    throw RecordingError(file.string() + ": the tables cannot be created; check that the disk is not full");
  write_fields(id);
  write_header(id, header);
  file_->flush();
}

RecordingWriter::~RecordingWriter() {
  const std::scoped_lock lock(hdf5_mutex());
  file_.reset();
}

void RecordingWriter::append(std::span<const TickRecord> records) {
  append(records, {}, {});
}

/// Writes the contacts first, so that a row of /ticks never refers to a missing row of /contacts.
void RecordingWriter::append(std::span<const TickRecord> ticks, std::span<const ContactRange> ranges,
                             std::span<const Touch> contacts) {
  const std::scoped_lock lock(hdf5_mutex());
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
  file_->append(file_->ticks, file_->tick_row, file_->tick_rows, file_->rows.data(), ticks.size());
}

void RecordingWriter::flush() {
  const std::scoped_lock lock(hdf5_mutex());
  file_->flush();
}

// ------------------------------------------------------------------------------------------------ Reading

namespace {

/// Why the file is rejected: a phrase without the file name.
class Rejected : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

[[noreturn]] void reject(const std::string& reason) {
  throw Rejected(reason);
}

/// An open recording.
struct OpenRecording {
  hid_t file;
  std::uint64_t bytes;  ///< Size of the file.
};

/// Requires that a name in a group is an object of this file. A link to another place or file would make the
/// library follow it.
void require_hard_link(hid_t group, const char* name) {
  H5L_info_t info{};
  if (H5Lget_info(group, name, &info, H5P_DEFAULT) < 0) reject("is damaged; use a complete copy");
  if (info.type != H5L_TYPE_HARD)
    reject("'" + std::string(name) +
           "' is a link to another object or file, which a recording never contains; the file was changed, "
           "take it as it was recorded");
}

bool has(hid_t group, const char* name) {
  if (H5Lexists(group, name, H5P_DEFAULT) <= 0) return false;
  require_hard_link(group, name);
  return true;
}

/// Rejects a data set whose content is elsewhere, or that would load a filter from a file.
void require_plain_storage(hid_t set, const std::string& name) {
  const Handle layout(H5Dget_create_plist(set), H5Pclose);
  const H5D_layout_t kind = layout.ok() ? H5Pget_layout(layout) : H5D_LAYOUT_ERROR;
  if (kind != H5D_CHUNKED && kind != H5D_CONTIGUOUS && kind != H5D_COMPACT)
    reject("'" + name + "' is not stored in this file, which a recording always is; the file was changed");
  if (H5Pget_external_count(layout) != 0)
    reject("'" + name +
           "' is stored in another file (external storage), which a recording never is; the file "
           "was changed, take it as it was recorded");
  const int filters = H5Pget_nfilters(layout);
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(layout, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE)
      reject("'" + name + "' has a filter that a recording never has; the file was changed");
  }
}

/// Opens a data set of this file. Throws Rejected.
hid_t open_set(hid_t group, const std::string& name) {
  require_hard_link(group, name.c_str());
  const hid_t set = H5Dopen2(group, name.c_str(), H5P_DEFAULT);
  if (set < 0) reject("'" + name + "' cannot be read; the file is damaged");
  try {
    require_plain_storage(set, name);
  } catch (...) {
    H5Dclose(set);
    throw;
  }
  return set;
}

/// Returns the text of an attribute or data set; returns an empty text if there is none.
template <class Read>
std::string text_of(const OpenRecording& recording, const Handle& type, const Read& read) {
  if (!type.ok() || H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) return {};
  const std::size_t size = H5Tget_size(type);
  if (size > std::min<std::uint64_t>(kMaxBytes, recording.bytes * kMaxExpansion)) return {};
  std::string text(size, '\0');
  if (read(text.data()) < 0) return {};
  text.resize(std::min(text.size(), text.find('\0')));  // an empty text is stored as one zero byte
  return text;
}

std::string read_text(const OpenRecording& recording, hid_t object, const char* name) {
  if (H5Aexists(object, name) <= 0) return {};
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return {};
  const Handle space(H5Aget_space(attribute), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  const Handle type(H5Aget_type(attribute), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0)
    return text_of(recording, type, [&](char* to) { return H5Aread(attribute, type, to); });
  char* bytes = nullptr;
  if (H5Aread(attribute, type, &bytes) < 0 || bytes == nullptr) return {};
  const std::string text = bytes;
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, &bytes);
  return text;
}

template <class T>
T read_number(hid_t object, const char* name, hid_t type, T otherwise) {
  if (H5Aexists(object, name) <= 0) return otherwise;
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return otherwise;
  const Handle space(H5Aget_space(attribute), H5Sclose);
  const Handle stored(H5Aget_type(attribute), H5Tclose);
  const H5T_class_t kind = H5Tget_class(stored);
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) return otherwise;
  T number = otherwise;
  if (H5Sget_simple_extent_npoints(space) != 1 || H5Aread(attribute, type, &number) < 0) return otherwise;
  return number;
}

std::string read_config(const OpenRecording& recording, hid_t set) {
  const Handle space(H5Dget_space(set), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  const Handle type(H5Dget_type(set), H5Tclose);
  return text_of(recording, type,
                 [&](char* to) { return H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, to); });
}

std::vector<std::string> names_in(hid_t group) {
  std::vector<std::string> names;
  H5Literate(
      group, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr,
      [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
        static_cast<std::vector<std::string>*>(list)->emplace_back(name);
        return 0;
      },
      &names);
  return names;
}

void read_mesh(const OpenRecording& recording, hid_t set, const std::string& role, RecordingEncoder& out) {
  const auto embedded = read_number<std::uint8_t>(set, "embedded", H5T_NATIVE_UINT8, 0) != 0;
  out.put(FrameKind::new_file, {});
  out.put(FrameKind::file_role, role);
  out.put(FrameKind::file_path, read_text(recording, set, "file"));
  out.put(FrameKind::file_sha256, read_text(recording, set, "sha256"));
  out.put(FrameKind::file_embedded, embedded ? std::string_view("\1", 1) : std::string_view("\0", 1));
  const Handle space(H5Dget_space(set), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (!embedded || count <= 0) return;
  const Handle type(H5Dget_type(set), H5Tclose);
  if (H5Tget_class(type) != H5T_INTEGER || H5Tget_size(type) != 1)
    reject("the mesh '" + role + "' does not consist of bytes; the file was changed");
  if (static_cast<std::uint64_t>(count) > std::min<std::uint64_t>(kMaxBytes, recording.bytes * kMaxExpansion))
    reject("the mesh '" + role + "' claims more bytes than the file can hold; the file is damaged");
  std::string bytes(static_cast<std::size_t>(count), '\0');
  if (H5Dread(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0)
    reject("the mesh '" + role + "' cannot be read; the file is damaged");
  out.put(FrameKind::file_bytes, bytes);
}

void read_files(const OpenRecording& recording, RecordingEncoder& out) {
  for (const char* group_name : {"config", "meshes"}) {
    if (!has(recording.file, group_name)) continue;
    const Handle group(H5Gopen2(recording.file, group_name, H5P_DEFAULT), H5Gclose);
    if (!group.ok()) continue;
    for (const std::string& name : names_in(group)) {
      const Handle set(open_set(group, name), H5Dclose);
      if (is_mesh(name)) {
        read_mesh(recording, set, name, out);
        continue;
      }
      const std::string path = read_text(recording, set, "file");
      const std::string text = read_config(recording, set);
      const auto put = [&](FrameKind of_text, FrameKind of_path) {
        out.put(of_text, text);
        out.put(of_path, path);
      };
      if (name == "settings") {
        put(FrameKind::settings, FrameKind::settings_file);
      } else if (name == "scene") {
        put(FrameKind::scene, FrameKind::scene_file);
      } else if (name == "profile") {
        put(FrameKind::profile, FrameKind::profile_file);
      } else {
        out.put(FrameKind::new_file, {});
        out.put(FrameKind::file_role, name);
        put(FrameKind::file_bytes, FrameKind::file_path);
        out.put(FrameKind::file_embedded, std::string_view("\1", 1));
      }
    }
  }
}

void read_header(const OpenRecording& recording, RecordingEncoder& out) {
  const hid_t file = recording.file;
  out.put(FrameKind::version, read_text(recording, file, "wrenchd_version"));
  out.put(FrameKind::kernel, read_text(recording, file, "kernel"));
  out.put(FrameKind::realtime, read_text(recording, file, "realtime"));
  RecordingFacts facts;
  facts.virtual_time = read_text(recording, file, "clock") == "virtual" ? 1 : 0;
  facts.rate_Hz = read_number(file, "rate_Hz", H5T_NATIVE_DOUBLE, 0.0);
  facts.started_ns = read_number<std::int64_t>(file, "started_ns", H5T_NATIVE_INT64, 0);
  facts.started_unix_ns = read_number<std::int64_t>(file, "started_unix_ns", H5T_NATIVE_INT64, 0);
  out.put(facts);
  read_files(recording, out);
}

/// Rejects a file of another format before anything is read, because its columns differ in name or meaning.
void check_format(const OpenRecording& recording) {
  std::string format = read_text(recording, recording.file, "format");
  std::string version = read_text(recording, recording.file, "wrenchd_version");
  if (format.empty()) {  // formats up to 5 have these attributes at the table
    if (!has(recording.file, "ticks")) reject("has no table 'ticks'; name a recording of wrenchd");
    const Handle table(open_set(recording.file, "ticks"), H5Dclose);
    format = read_text(recording, table, "format");
    version = read_text(recording, table, "wrenchd_version");
    if (format.empty()) format = "1";
  }
  if (format != kFormat)
    reject("was written by wrenchd " + (version.empty() ? "of an unknown version" : version) +
           " in recording format " + format + ", and this wrenchd reads format " + kFormat +
           "; replay or export it with the version that wrote it");
}

/// Returns true if a column has the class, size and dimension that the writer gives it. Other types would
/// need conversions, and may refer to other places of the file.
bool has_type_of(const RecordField& field, hid_t column) {
  const hid_t element = type_of(field.type);
  if (field.count == 1)
    return H5Tget_class(column) == H5Tget_class(element) && H5Tget_size(column) == H5Tget_size(element);
  if (H5Tget_class(column) != H5T_ARRAY || H5Tget_array_ndims(column) != 1) return false;
  hsize_t count = 0;
  if (H5Tget_array_dims2(column, &count) != 1 || count != field.count) return false;
  const Handle base(H5Tget_super(column), H5Tclose);
  return H5Tget_class(base) == H5Tget_class(element) && H5Tget_size(base) == H5Tget_size(element);
}

/// Rejects a table that has other columns than those that the writer makes.
void check_columns(const TableKind& table, hid_t set) {
  const Handle type(H5Dget_type(set), H5Tclose);
  if (H5Tget_class(type) != H5T_COMPOUND)
    reject("table '" + std::string(table.name) + "' has no columns; name a recording of wrenchd");
  for (const RecordField& field : table.fields) {
    const std::string named = "column '" + std::string(field.name) + "' of table '" + table.name + "'";
    const int index = H5Tget_member_index(type, field.name);
    if (index < 0) reject(named + " is missing; the file was changed, take it as it was recorded");
    const Handle column(H5Tget_member_type(type, static_cast<unsigned>(index)), H5Tclose);
    if (!column.ok() || !has_type_of(field, column))
      reject(named + " has another type than recordings have; the file was changed");
  }
  if (static_cast<std::size_t>(H5Tget_nmembers(type)) != table.fields.size())
    reject("table '" + std::string(table.name) +
           "' has columns that recordings do not have; the file was "
           "changed");
}

void read_table(const OpenRecording& recording, const TableKind& table, FrameKind kind,
                RecordingEncoder& out) {
  if (!has(recording.file, table.path + 1))
    reject("has no table '" + std::string(table.name) + "'; name a recording of wrenchd");
  const Handle set(open_set(recording.file, table.path + 1), H5Dclose);
  check_columns(table, set);
  const Handle space(H5Dget_space(set), H5Sclose);
  hsize_t rows = 0;
  if (H5Sget_simple_extent_ndims(space) != 1 || H5Sget_simple_extent_dims(space, &rows, nullptr) != 1)
    reject("table '" + std::string(table.name) + "' is not one-dimensional; the file is damaged");
  if (rows > recording.bytes * kMaxExpansion / table.row_bytes + 1)
    reject("table '" + std::string(table.name) + "' cannot have the " + std::to_string(rows) +
           " rows that its header states; the file is damaged");
  const Handle row(row_type(table), H5Tclose);
  const std::size_t rows_in_frame = RecordingEncoder::kMaxFrame_bytes / table.row_bytes;
  const hsize_t step = std::min<hsize_t>(kReadRows, rows_in_frame);
  std::vector<char> bytes(step * table.row_bytes);
  for (hsize_t first = 0; first < rows; first += step) {
    const hsize_t count = std::min(step, rows - first);
    const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    std::fill(bytes.begin(), bytes.end(), '\0');  // the padding
    if (H5Sselect_hyperslab(space, H5S_SELECT_SET, &first, nullptr, &count, nullptr) < 0 ||
        H5Dread(set, row, in_memory, space, H5P_DEFAULT, bytes.data()) < 0)
      reject("table '" + std::string(table.name) + "' cannot be read; the file is damaged or truncated");
    out.put(kind, {bytes.data(), count * table.row_bytes});
  }
}

/// The file image of the core driver of libhdf5. The library uses the bytes where they are, and opens no
/// file.
void* image_malloc(std::size_t, H5FD_file_image_op_t, void* image) {
  return const_cast<char*>(static_cast<std::span<const char>*>(image)->data());
}
void* image_memcpy(void* to, const void*, std::size_t, H5FD_file_image_op_t, void*) {
  return to;
}
void* image_realloc(void*, std::size_t, H5FD_file_image_op_t, void*) {
  return nullptr;  // a file that is only read does not grow
}
herr_t image_free(void*, H5FD_file_image_op_t, void*) {
  return 0;
}
void* image_copy_data(void* image) {
  return image;
}
herr_t image_free_data(void*) {
  return 0;
}

hid_t open_image(std::span<const char>& bytes) {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5FD_file_image_callbacks_t callbacks = {image_malloc,    image_memcpy,    image_realloc, image_free,
                                           image_copy_data, image_free_data, &bytes};
  if (H5Pset_fapl_core(access, std::size_t{1} << 16, 0) < 0 ||
      H5Pset_file_image_callbacks(access, &callbacks) < 0 ||
      H5Pset_file_image(access, const_cast<char*>(bytes.data()), bytes.size()) < 0)
    return -1;
  return H5Fopen("recording", H5F_ACC_RDONLY, access);
}

constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";

void parse(std::span<const char>& bytes, RecordingEncoder& out) {
  H5PLset_loading_state(0);  // no filters from files
  const Handle file(bytes.empty() ? -1 : open_image(bytes), H5Fclose);
  if (!file.ok())
    reject(std::string_view(bytes.data(), bytes.size()).starts_with(kSignature)
               ? "is truncated or damaged; use a complete copy"
               : "is not an HDF5 file; name a recording of wrenchd");
  const OpenRecording recording{file, bytes.size()};
  for (const std::string& name : names_in(file)) require_hard_link(file, name.c_str());
  check_format(recording);
  read_header(recording, out);
  read_table(recording, tick_table(), FrameKind::ticks, out);
  read_table(recording, contact_table(), FrameKind::contacts, out);
  out.put(FrameKind::end, {});
}

}  // namespace

void parse_recording(std::span<const char> bytes, RecordingEncoder& out) {
  silence_hdf5();
  try {
    parse(bytes, out);
  } catch (const Rejected& error) {
    out.put(FrameKind::error, error.what());
  }
}

}  // namespace wrenchd
