// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/recording/recording_file.hpp"
#include "daemon/recording/recording_tables.hpp"

namespace wrenchd {

// A recording as a stream of plain frames. The child process that reads an HDF5 file with libhdf5 writes the
// stream; the process that wants the recording decodes it. The decoder trusts nothing: a hostile file may
// have taken over the child.
//
//   frame: u8 kind, u32 length, `length` bytes. Texts and tables may come in several frames.

/// Kind of a frame.
enum class FrameKind : std::uint8_t {
  error = 1,  ///< why the file is rejected; the last frame
  version,
  kernel,
  realtime,
  settings,
  settings_file,
  scene,
  scene_file,
  profile,
  profile_file,
  facts,  ///< RecordingFacts
  new_file,
  file_role,
  file_path,
  file_sha256,
  file_embedded,  ///< one byte
  file_bytes,
  ticks,     ///< whole rows: TickRow
  contacts,  ///< whole rows: Touch
  end,       ///< the recording is complete; the last frame
};

/// The numbers of a header.
struct RecordingFacts {
  double rate_Hz = 0.0;
  std::int64_t started_ns = 0;
  std::int64_t started_unix_ns = 0;
  std::uint64_t virtual_time = 0;
};

/// Encodes frames. Not RT-safe: allocates, and writes through `write`.
class RecordingEncoder {
 public:
  using Write = std::function<void(std::string_view bytes)>;
  explicit RecordingEncoder(Write write) : write_(std::move(write)) {}

  /// Writes the content in one or several frames.
  void put(FrameKind kind, std::string_view content);
  void put(const RecordingFacts& facts);

  static constexpr std::size_t kMaxFrame_bytes = std::size_t{1} << 20;

 private:
  Write write_;
};

/// Decodes frames from a process that is not trusted. Not RT-safe: allocates.
class RecordingDecoder {
 public:
  /// name: file name for messages. max_bytes: largest total size of the stream.
  RecordingDecoder(std::string name, std::uint64_t max_bytes)
      : name_(std::move(name)), max_bytes_(max_bytes) {}

  /// Takes the next bytes of the stream. Returns false after the last frame. Throws RecordingError if the
  /// stream is invalid or reports an error.
  bool feed(std::string_view bytes);
  /// True if the end of the stream was received.
  bool complete() const noexcept { return complete_; }
  /// Returns the recording. Drops rows at the end that a dying process did not write. Throws RecordingError
  /// if the stream is incomplete.
  Recording take();

 private:
  void take_frame(FrameKind kind, std::string_view content);
  RecordedFile& last_file();
  [[noreturn]] void reject() const;

  std::string name_;
  std::uint64_t max_bytes_;
  std::uint64_t received_bytes_ = 0;
  std::string pending_;
  bool complete_ = false;
  Recording recording_;
  std::vector<TickRow> rows_;
};

/// Protects libhdf5 in this process while it writes recordings, and while a child is forked: a child must not
/// inherit a lock that another thread holds.
std::mutex& hdf5_mutex();

/// Initialises libhdf5, so that a child that is forked later need not. Precondition: hdf5_mutex() is locked.
void initialize_hdf5();

/// Reads the bytes of an HDF5 file with libhdf5, and writes them to the encoder; an error as a frame `error`.
/// Follows no link, and opens no other file. A damaged or hostile file may crash or hang this function: call
/// it only in a process of its own. bytes: must stay unchanged. Not RT-safe: may take long.
void parse_recording(std::span<const char> bytes, RecordingEncoder& out);

}  // namespace wrenchd
