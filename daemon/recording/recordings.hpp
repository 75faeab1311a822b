// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/fault.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/recording/event_log.hpp"
#include "daemon/recording/marker.hpp"
#include "daemon/recording/record_history.hpp"
#include "daemon/recording/recorder.hpp"
#include "daemon/recording/recording_directory.hpp"
#include "daemon/thread_guard.hpp"

namespace wrenchd {

class Runtime;

/// The recordings of a running daemon: the requested recording, and those of the flight recorder. The flight
/// recorder stores the last seconds in memory. For each fault that latches or releases the hand it writes
/// them to a file, together with the second after the fault.
///
/// The servo loop writes every tick to the shared memory (daemon/servo/shared_state.hpp) and never waits for
/// a recording. A collector thread copies the ticks to the history; a writer thread copies them from there to
/// files. No tick is lost if the disk pauses for less than the length of the history. Emits the events
/// `recording`. Not RT-safe: locks. Any thread except the servo thread.
class Recordings {
 public:
  enum class Pace : std::uint8_t {
    threads,  ///< wall time: collector and writer have threads
    manual,   ///< virtual time: the caller calls pump() at least once a second of loop time; no flight
              ///< recorder
  };

  /// Precondition: the loop does not run yet. Runtime and feed must outlive this object. Throws
  /// std::system_error.
  Recordings(Runtime& runtime, EventFeed& feed, const Clock& clock, Pace pace = Pace::threads);
  /// Calls close().
  ~Recordings();
  Recordings(const Recordings&) = delete;
  Recordings& operator=(const Recordings&) = delete;

  /// Ends the threads, writes the stored ticks, and closes the files. No recording can start any more. Call
  /// it when the loop has ended. Reports errors as events.
  void close() noexcept;

  /// Starts to write every tick to a file, and returns the file. requested: a name in the recordings
  /// directory; empty: a name with the present time. If `anywhere` is set, an absolute path is permitted too.
  /// The name of the second hand is added to it, so that both hands may get the same name.
  /// Throws RecordingError, also if a recording is already running.
  std::filesystem::path start(const std::string& requested, bool anywhere);
  /// Starts to write every tick to this file. A relative path starts at the working directory.
  void start_file(const std::filesystem::path& file);

  struct Summary {
    std::filesystem::path file;
    std::uint64_t ticks = 0;
    std::uint64_t lost = 0;  ///< number of ticks missing in the file
  };
  /// Writes the remaining ticks and closes the file. Returns nothing if no recording runs.
  std::optional<Summary> stop();

  struct Marked {
    std::filesystem::path file;  ///< the running recording
    std::int64_t time_ns = 0;    ///< time of the marker, on the clock of the ticks
  };
  /// Sets a marker in the running recording, with conditions that hold until the next marker changes them,
  /// and emits the event `marker`. conditions: an object of numbers and texts (daemon/recording/marker.hpp).
  /// Returns nothing if no recording runs. Throws std::invalid_argument if the marker exceeds its bounds, and
  /// RecordingError if there are too many markers per second.
  std::optional<Marked> mark(const std::string& label, const Json& conditions);

  /// Returns the complete recordings in the recordings directory, the oldest first.
  std::vector<StoredRecording> list() const;
  /// Opens a complete recording for reading. Throws RecordingError.
  OwnedFd open(const std::string& name) const;

  struct Status {
    std::optional<Summary> running;  ///< the running recording so far
    std::string failed;              ///< why the last recording ended early; empty: it did not
    std::filesystem::path directory;
    double flight_s = 0.0;  ///< duration that the flight recorder stores; 0: no flight recorder
    std::filesystem::path last_flight;
    std::uint64_t flights = 0;  ///< number of flights written since the start
  };
  /// Does not wait for the disk.
  Status status() const;

  /// Collects and writes the ticks that are there (Pace::manual).
  void pump();

 private:
  struct Flight {
    std::filesystem::path file;
    Fault fault = Fault::none;
    std::int64_t until_ns = 0;
    std::uint64_t first = 0;          ///< number of the first record of the flight
    std::int64_t from_ns = 0;         ///< time from which the flight contains events
    std::uint64_t missed_before = 0;  ///< missed_total_ when the fault was raised
    TimePoint requested_at{};
    std::unique_ptr<Recorder> recorder;  ///< null before the writer begins
    std::uint64_t end = 0;               ///< number of the first record after the flight; valid with recorder
  };

  void begin(const std::filesystem::path& file, const std::filesystem::path& directory);
  void collect_ticks();
  bool write(bool rest);
  bool write_running(bool rest);
  bool write_flight(bool rest);
  void write_events(Recorder& recorder, EventLog& log, bool all);
  void check_disk_space();
  Summary finish();
  void fail(const std::string& why);
  void end_flight(const std::string& why);
  std::string begin_flight(Fault fault, TimePoint at);
  void publish();
  bool is_being_written(const std::filesystem::path& file) const;

  Runtime& runtime_;
  EventFeed& feed_;
  const Clock& clock_;
  RecordingSettings settings_;
  std::filesystem::path directory_;
  double flight_s_;
  EventLog::EmittedTime emitted_time_;
  SharedState& state_;
  RecordHistory history_;

  std::mutex collect_mutex_;       ///< protects next_record_, missed_ and record_
  std::uint64_t next_record_ = 0;  ///< next record of the shared memory to collect
  std::uint64_t missed_ = 0;       ///< records that were overwritten before they were collected
  StateRecord record_;

  std::mutex write_mutex_;  ///< protects the members up to missed_at_start_
  bool closed_ = false;     ///< no recording can start any more
  std::unique_ptr<Recorder> running_;
  std::unique_ptr<EventLog> running_events_;  ///< not null while a recording runs
  std::filesystem::path running_directory_;   ///< directory of the running recording; an absolute path
  std::uint64_t missed_at_start_ = 0;         ///< missed_total_ at the start of the running recording

  std::mutex marker_mutex_;  ///< protects marker_rate_
  MarkerRate marker_rate_;

  mutable std::mutex status_mutex_;  ///< protects flight_ and status_
  std::optional<Flight> flight_;
  Status status_;

  std::atomic<std::uint64_t> missed_total_{0};
  ThreadGuard close_guard_{"recordings"};
  std::jthread collector_, writer_;  ///< last members: they use the members above
};

}  // namespace wrenchd
