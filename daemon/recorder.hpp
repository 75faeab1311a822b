// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "daemon/recording_file.hpp"
#include "daemon/servo_loop.hpp"

namespace wrenchd {

/// Carries records from the servo thread to a recording, on a thread of its own.
class Recorder {
 public:
  /// How many records the ring should hold: two seconds at 8 kHz, so that a slow disk loses nothing.
  static constexpr std::size_t kRingRecords = 16384;

  /// Starts at once. Throws RecordingError.
  Recorder(RecordRing& ring, const std::filesystem::path& file, const RecordingHeader& header);
  /// Writes what is still in the ring, and closes the file.
  ~Recorder();

  /// Empty while all went well; otherwise why the recording stopped.
  std::string error() const;
  std::uint64_t written() const noexcept { return written_.load(std::memory_order_relaxed); }

 private:
  void drain();
  void run(const std::stop_token& stop);

  RecordRing& ring_;
  RecordingWriter writer_;
  std::vector<TickRecord> batch_;
  std::atomic<std::uint64_t> written_{0};
  std::atomic<bool> failed_{false};
  std::string error_;  ///< written before failed_, read after it
  std::jthread thread_;
};

}  // namespace wrenchd
