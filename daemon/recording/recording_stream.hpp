// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "daemon/recording/recording_file.hpp"
#include "daemon/recording/recording_rows.hpp"

namespace wrenchd {

/// Sends a recording through a pipe: the child process that calls libhdf5 is the sender. Not RT-safe: writes
/// to a pipe.
class RecordingSender {
 public:
  explicit RecordingSender(int pipe) : pipe_(pipe) {}

  /// The members throw RecordingError if the receiver has gone.
  void send(const RecordingHeader& header);
  void send(std::span<const TickRow> rows);
  void send(std::span<const Touch> rows);
  void send(std::span<const RecordedEvent> events);
  void end();
  /// Says why the file is rejected, in place of end(). reason: without the name of the file.
  void reject(const std::string& reason);

 private:
  void message(std::uint8_t kind, const void* data, std::size_t bytes);

  int pipe_;
};

/// A recording as it came through a pipe, before contacts are assigned to ticks.
struct ReceivedRecording {
  RecordingHeader header;
  std::vector<TickRow> ticks;
  std::vector<Touch> contacts;
  std::vector<RecordedEvent> events;
};

/// The sender has ended, or what it sent is no recording.
class BrokenStream : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Receives a recording. The sender may have been taken over by a hostile file, so nothing that it sends is
/// trusted: sizes are bounded by most_bytes, and every value that stands for a name must have one.
/// file: for messages. keep_waiting: called while the sender is silent; throws to give up. Throws
/// RecordingError with the reason of RecordingSender::reject(), BrokenStream if the sender ends too early or
/// sends anything else. Not RT-safe: reads from a pipe.
ReceivedRecording receive_recording(int pipe, const std::filesystem::path& file, std::uint64_t most_bytes,
                                    const std::function<void()>& keep_waiting);

}  // namespace wrenchd
