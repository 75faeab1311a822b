// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording_file.hpp"

#include <hdf5.h>

#include "daemon/record_fields.hpp"

namespace wrenchd {
namespace {

constexpr const char* kTable = "/ticks";
/// Of the columns and of what they say. 1 (without the attribute): the first q was computed in the tick, and
/// is not the placer's; 2: `placing` and `start_over`; 3: `dropped`; 4: states and faults; 5: what
/// was changed while the loop ran.
constexpr const char* kFormat = "5";
constexpr hsize_t kChunkRows =
    1024;  ///< about a second at 1 kHz: what a crash can cost, and a good block to compress
constexpr unsigned kDeflateLevel = 1;

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

/// HDF5 prints its error stack unless told not to; our errors say what matters.
void quiet() {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

hid_t row_type() {
  const hid_t row = H5Tcreate(H5T_COMPOUND, sizeof(TickRecord));
  for (const RecordField& field : tick_fields()) {
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

std::string units() {
  std::string text;
  for (const RecordField& field : tick_fields()) text += std::string(field.name) + " [" + field.unit + "]\n";
  return text;
}

void write_text(hid_t object, const char* name, const std::string& text) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, text.empty() ? 1 : text.size());
  H5Tset_cset(type, H5T_CSET_UTF8);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const std::string padded = text.empty() ? std::string(1, '\0') : text;
  H5Awrite(attribute, type, padded.data());
}

std::string read_text(hid_t object, const char* name) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return {};
  const Handle type(H5Aget_type(attribute), H5Tclose);
  std::string text(H5Tget_size(type), '\0');
  if (H5Aread(attribute, type, text.data()) < 0) return {};
  return text[0] == '\0' ? std::string() : text;
}

}  // namespace

struct RecordingWriter::File {
  Handle file;
  Handle row;
  Handle table;
  hsize_t rows = 0;
};

namespace {

hid_t create_table(hid_t file, hid_t row) {
  const hsize_t none = 0;
  const hsize_t unlimited = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &none, &unlimited), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(layout, 1, &kChunkRows);
  H5Pset_shuffle(layout);
  H5Pset_deflate(layout, kDeflateLevel);
  return H5Dcreate2(file, kTable, row, space, H5P_DEFAULT, layout, H5P_DEFAULT);
}

}  // namespace

RecordingWriter::RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header) {
  quiet();
  if (std::filesystem::exists(file))
    throw RecordingError(file.string() +
                         ": exists already, and a recording is never overwritten; choose another name");
  const hid_t id = H5Fcreate(file.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT);
  if (id < 0)
    throw RecordingError(file.string() +
                         ": cannot be created; check that the directory exists and may be written to");
  const hid_t row = row_type();
  file_.reset(new File{Handle(id, H5Fclose), Handle(row, H5Tclose), Handle(create_table(id, row), H5Dclose)});
  if (!file_->table.ok()) throw RecordingError(file.string() + ": the table of ticks cannot be created");
  write_text(file_->table, "units", units());
  write_text(file_->table, "wrenchd_version", header.version);
  write_text(file_->table, "format", kFormat);
  write_text(file_->table, "settings", header.settings);
  write_text(file_->table, "scene", header.scene);
  write_text(file_->table, "profile", header.profile);
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::append(std::span<const TickRecord> records) {
  if (records.empty()) return;
  const hsize_t start = file_->rows;
  const hsize_t count = records.size();
  const hsize_t total = start + count;
  if (H5Dset_extent(file_->table, &total) < 0)
    throw RecordingError("the recording cannot grow; is the disk full?");
  const Handle in_file(H5Dget_space(file_->table), H5Sclose);
  H5Sselect_hyperslab(in_file, H5S_SELECT_SET, &start, nullptr, &count, nullptr);
  const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
  if (H5Dwrite(file_->table, file_->row, in_memory, in_file, H5P_DEFAULT, records.data()) < 0)
    throw RecordingError("a recording could not be written; is the disk full?");
  H5Fflush(file_->file, H5F_SCOPE_LOCAL);
  file_->rows = total;
}

Recording read_recording(const std::filesystem::path& file) {
  quiet();
  const Handle opened(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!opened.ok())
    throw RecordingError(file.string() +
                         ": is not there, or is not an HDF5 file; name a recording of wrenchd");
  const Handle table(H5Dopen2(opened, kTable, H5P_DEFAULT), H5Dclose);
  if (!table.ok())
    throw RecordingError(file.string() + ": has no table 'ticks'; name a recording of wrenchd");
  const Handle space(H5Dget_space(table), H5Sclose);
  hsize_t rows = 0;
  H5Sget_simple_extent_dims(space, &rows, nullptr);

  Recording recording;
  recording.header = {read_text(table, "wrenchd_version"), read_text(table, "settings"),
                      read_text(table, "scene"), read_text(table, "profile")};
  const std::string named = read_text(table, "format");
  const std::string format = named.empty() ? std::string("1") : named;
  if (format != kFormat)
    throw RecordingError(file.string() + ": is of format " + format + ", and format " + kFormat +
                         " is what can be read; replay it with the wrenchd that wrote it (" +
                         recording.header.version + ")");
  recording.ticks.resize(rows);
  const Handle row(row_type(), H5Tclose);
  if (rows > 0 && H5Dread(table, row, H5S_ALL, H5S_ALL, H5P_DEFAULT, recording.ticks.data()) < 0)
    throw RecordingError(file.string() + ": its ticks cannot be read; it was written by another version (" +
                         recording.header.version + ")");
  return recording;
}

}  // namespace wrenchd
