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
#include "daemon/recording/recorded_event.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// A recording cannot be written or read. The message names the file, the reason and the remedy.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file that the run used as input.
struct RecordedFile {
  std::string role;  ///< "hand_script", "profile_1" (a parent of the profile), "tool", "obstacle_0".
  std::filesystem::path path;  ///< Path from which the file was read.
  std::string sha256;          ///< SHA-256 of the contents, in hexadecimal.
  bool embedded = true;        ///< False if the contents are too large for the recording.
  std::string bytes;           ///< Contents; empty if not embedded.
};

/// Everything but ticks that is needed to understand and replay a recording on its own.
struct RecordingHeader {
  std::string version;   ///< Version of wrenchd.
  std::string settings;  ///< Text of the configuration file.
  std::string scene;     ///< Text of the scene file.
  std::string profile;   ///< Text of the profile.
  std::filesystem::path settings_file;
  std::filesystem::path scene_file;
  std::filesystem::path profile_file;
  std::vector<RecordedFile> files;  ///< Other inputs: parents of the profile, hand script, meshes.
  std::string realtime;             ///< Real-time setting of the run: "required", "best_effort" or "off".
  double rate_Hz = 0.0;             ///< Configured rate of the servo loop.
  std::string kernel;               ///< Name and release of the kernel.
  bool virtual_time = false;        ///< True if the run used virtual time.
  int hands = 1;                    ///< Number of hands of the run; a recording has the ticks of one hand.
  std::string hand;                 ///< Name of the hand of these ticks; empty: the first hand.
  // One moment on two clocks: unix_ns = started_unix_ns + (now_ns - started_ns).
  std::int64_t started_ns = 0;       ///< Start of the recording, on the clock of the ticks.
  std::int64_t started_unix_ns = 0;  ///< Start of the recording, UTC since 1970.
};

/// Rows of /contacts that belong to one tick.
struct ContactRange {
  std::uint64_t first = 0;
  std::uint32_t count = 0;
};

/// Consecutive ticks with their contacts.
struct RecordBatch {
  std::vector<TickRecord> ticks;
  std::vector<ContactRange> contact_ranges;  ///< Range in `contacts` for each tick.
  std::vector<Touch> contacts;

  /// Removes all ticks. Not RT-safe.
  void clear();
  /// Appends one tick with its contacts. Not RT-safe: allocates.
  void add(const TickRecord& tick, std::span<const Touch> tick_contacts);
};

/// Writes an HDF5 file that any HDF5 reader can open: h5dump, h5py, MATLAB.
///
///   /ticks      one row per tick, one column per field; columns first_contact and contact_count refer to
///               rows of /contacts
///   /contacts   one row per contact, one column per field
///   /events     one row per event of the daemon and per marker: time, tick, severity, name, text, value,
///               conditions
///   /fields     description of the columns of the tables: table, name, type, count, unit, frame, meaning,
///               names of the values
///   /config     texts: settings, scene, profile, hand_script, parents of the profile
///   /meshes     contents of the mesh files tool, obstacle_0, ..., body_0, ..., with path and SHA-256
///
/// Unit, frame and meaning of column X are also the attributes "X.unit", "X.frame" and "X.doc" of its table.
/// Attributes of the file: format, versions, rate, and start time on the clock of the ticks and in UTC. If
/// two hands ran: their number, and the name of the hand that has these ticks.
///
/// Flushed data survive if the process dies. For one thread at a time. Not RT-safe: writes a file.
class RecordingWriter {
 public:
  /// Creates the file. Throws RecordingError, also if the file exists: a recording is never overwritten.
  RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// Appends ticks without contacts. Throws RecordingError.
  void append(std::span<const TickRecord> records);
  /// Appends ticks with contacts. Throws RecordingError.
  void append(const RecordBatch& batch) { append(batch.ticks, batch.contact_ranges, batch.contacts); }
  /// Appends events. Throws RecordingError.
  void append_events(std::span<const RecordedEvent> events);
  /// Passes all appended data to the operating system. Throws RecordingError.
  void flush();

  /// Number of rows that HDF5 compresses and writes together.
  static constexpr std::size_t kChunkTicks = 512;

 private:
  void append(std::span<const TickRecord> ticks, std::span<const ContactRange> ranges,
              std::span<const Touch> contacts);

  struct File;
  std::unique_ptr<File> file_;
};

/// A complete recording in memory.
struct Recording {
  RecordingHeader header;
  std::vector<TickRecord> ticks;
  std::vector<ContactRange> contact_ranges;  ///< Range in `contacts` for each tick.
  std::vector<Touch> contacts;
  std::vector<RecordedEvent> events;

  /// Returns the contacts of the tick in this row. RT-safe.
  std::span<const Touch> contacts_of(std::size_t row) const {
    return std::span(contacts).subspan(contact_ranges[row].first, contact_ranges[row].count);
  }
};

/// Reads a recording bit for bit. Drops unfinished rows at the end, which a dying process leaves. Throws
/// RecordingError; a recording of another format is rejected with the version that wrote it.
///
/// libhdf5 crashes, loops or opens other files if a file tells it to. So a child process calls it, with
/// limits of address space, processor time and system calls, and sends the rows through a pipe. The child
/// rejects what wrenchd never writes before libhdf5 acts on it: external storage, virtual data sets, links to
/// other files or names, filters from plugins, other types, and more rows than the file can hold. If the
/// child crashes or exceeds a limit, the file is rejected as damaged. Not RT-safe: reads a file, starts a
/// process.
Recording read_recording(const std::filesystem::path& file);

}  // namespace wrenchd
