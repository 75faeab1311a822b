// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "collision/touch.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// A recording that cannot be written or read: which file, why, and what to do.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file that a run was made of.
struct RecordedFile {
  std::string role;  ///< "hand_script", "profile_1" (a parent), "tool", "obstacle_0": what it was to the run
  std::filesystem::path path;  ///< where it was read from
  std::string sha256;          ///< of its bytes, in hexadecimal
  bool embedded = true;        ///< else its bytes are not in the recording: it is too large
  std::string bytes;
};

/// What a recording must know besides its ticks, so that it can be understood and replayed on its own.
struct RecordingHeader {
  std::string version;   ///< of wrenchd
  std::string settings;  ///< text of the files it ran with
  std::string scene;
  std::string profile;
  std::filesystem::path settings_file;  ///< where those texts are from
  std::filesystem::path scene_file;
  std::filesystem::path profile_file;
  std::vector<RecordedFile> files;  ///< the others: parents of the profile, hand script, meshes
  std::string realtime;             ///< as it ran: "required", "best_effort", "off"
  double rate_Hz = 0.0;
  std::string kernel;  ///< name and release
  bool virtual_time = false;
  // One moment by two clocks: unix_ns = started_unix_ns + (now_ns - started_ns).
  std::int64_t started_ns = 0;       ///< by the clock of the ticks
  std::int64_t started_unix_ns = 0;  ///< since 1970, UTC
};

/// The rows of /touches that belong to a tick.
struct ContactRange {
  std::uint64_t first = 0;
  std::uint32_t count = 0;
};

/// Ticks one after the other, each with the contacts that hold it.
struct RecordBatch {
  std::vector<TickRecord> ticks;
  std::vector<ContactRange> contact_ranges;  ///< one a tick, into touches
  std::vector<Touch> contacts;

  void clear();
  void add(const TickRecord& tick, std::span<const Touch> its);
};

/// An HDF5 file that any reader opens: h5dump, h5py, MATLAB.
///
///   /ticks      one row a tick, one named column a field, and first_touch, touch_count: its rows of /touches
///   /touches    one row a contact, likewise
///   /fields     of both tables: name, type, count, unit, frame, doc, names of values
///   /config     settings, scene, profile: texts; hand_script and parents of the profile where there are any
///   /meshes     tool, obstacle_0, ...: the bytes of the mesh files, with name and SHA-256
///
/// The unit, frame and meaning of column X are also the attributes "X.unit", "X.frame", "X.doc" of its table.
/// Attributes of the file: format, versions, rate, and when it began, by the clock of the ticks and by UTC.
///
/// What was flushed is there when the process dies. Not RT safe; one thread at a time.
class RecordingWriter {
 public:
  /// Throws RecordingError. An existing file is refused: a recording is never overwritten.
  RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// Ticks without contacts.
  void append(std::span<const TickRecord> records);
  void append(const RecordBatch& batch) { append(batch.ticks, batch.contact_ranges, batch.contacts); }
  /// Brings what was appended to where it outlives this process. Throws RecordingError.
  void flush();

  /// Rows that are compressed and written at once.
  static constexpr std::size_t kChunkTicks = 512;

 private:
  void append(std::span<const TickRecord> ticks, std::span<const ContactRange> ranges,
              std::span<const Touch> touches);

  struct File;
  std::unique_ptr<File> file_;
};

struct Recording {
  RecordingHeader header;
  std::vector<TickRecord> ticks;
  std::vector<ContactRange> contact_ranges;  ///< one a tick, into touches
  std::vector<Touch> contacts;

  /// The contacts of the tick in that row.
  std::span<const Touch> contacts_of(std::size_t row) const {
    return std::span(contacts).subspan(contact_ranges[row].first, contact_ranges[row].count);
  }
};

/// Reads a recording back, bit for bit. Rows at the end that a process which died had not finished are left
/// out. Throws RecordingError, also for a recording of another format: what it leaves out would be made up.
Recording read_recording(const std::filesystem::path& file);

}  // namespace wrenchd
