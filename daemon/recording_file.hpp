// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/tick_record.hpp"

namespace wrenchd {

/// A recording that cannot be written or read: which file, why, and what to do.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a recording must know besides its ticks, so that it can be understood and replayed on its own.
struct RecordingHeader {
  std::string version;   ///< of wrenchd
  std::string settings;  ///< text of the files it ran with
  std::string scene;
  std::string profile;
};

/// An HDF5 file with one table, /ticks: one row a tick, one named column a field. Attributes of the table:
/// "units", "format" (of the columns), and what the header says. Any HDF5 reader opens it: h5dump, h5py,
/// MATLAB. Not RT safe.
class RecordingWriter {
 public:
  /// Throws RecordingError. An existing file is refused: a recording is never overwritten.
  RecordingWriter(const std::filesystem::path& file, const RecordingHeader& header);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  void append(std::span<const TickRecord> records);

 private:
  struct File;
  std::unique_ptr<File> file_;
};

struct Recording {
  RecordingHeader header;
  std::vector<TickRecord> ticks;
};

/// Reads a recording back, bit for bit. Throws RecordingError, also for a recording of another format: what
/// it leaves out would be made up.
Recording read_recording(const std::filesystem::path& file);

}  // namespace wrenchd
