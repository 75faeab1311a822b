// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "daemon/recording/record_history.hpp"
#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// Copies records from the history to one file, in pieces. One thread at a time. Not RT-safe: writes a file.
class Recorder {
 public:
  /// first: number of the first record to write. Throws RecordingError.
  Recorder(const RecordHistory& history, const std::filesystem::path& file, const RecordingHeader& header,
           std::uint64_t first);

  /// Writes the next piece of the stored records whose number is below `end`. A piece has whole chunks, which
  /// cost least; with `rest` set it also includes an incomplete last chunk. Returns false if there is nothing
  /// to write now. Throws RecordingError.
  bool write_next(std::uint64_t end, bool rest);

  /// Writes events with the tick that was in progress. Throws RecordingError.
  void write_events(std::span<RecordedEvent> events);

  const std::filesystem::path& file() const noexcept { return file_; }
  std::uint64_t next() const noexcept { return next_; }        ///< number of the next record to write
  std::uint64_t written() const noexcept { return written_; }  ///< ticks
  std::uint64_t lost() const noexcept { return lost_; }        ///< ticks that left the history unwritten

 private:
  const RecordHistory& history_;
  std::filesystem::path file_;
  RecordingWriter writer_;
  std::uint64_t next_;
  std::uint64_t written_ = 0;
  std::uint64_t lost_ = 0;
  RecordBatch batch_;
};

}  // namespace wrenchd
