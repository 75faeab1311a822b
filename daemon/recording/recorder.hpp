// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>

#include "daemon/recording/record_history.hpp"
#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// Carries records from the history to one file, a piece at a time. One thread at a time.
class Recorder {
 public:
  /// first: number of the first record to write. Throws RecordingError.
  Recorder(const RecordHistory& history, const std::filesystem::path& file, const RecordingHeader& header,
           std::uint64_t first);

  /// Writes the next piece of what is held before that number: whole chunks, which cost least, or, where
  /// `rest` is set, what is left too. False: there is nothing to write now. Throws RecordingError.
  bool write_next(std::uint64_t end, bool rest);

  const std::filesystem::path& file() const noexcept { return file_; }
  std::uint64_t next() const noexcept { return next_; }        ///< number of the next record to write
  std::uint64_t written() const noexcept { return written_; }  ///< ticks
  std::uint64_t lost() const noexcept { return lost_; }  ///< that were held no more when their turn came

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
