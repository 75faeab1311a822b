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
#include "daemon/recording/record_history.hpp"
#include "daemon/recording/recorder.hpp"
#include "daemon/recording/recording_directory.hpp"

namespace wrenchd {

class Runtime;

/// All recordings of a running daemon: the one that somebody asked for, and those of the flight recorder,
/// which holds the last seconds in memory and writes them, and the second after, for each fault that latches
/// or lets go of the hand.
///
/// Ticks are taken from the shared memory (daemon/servo/shared_state.hpp), which the loop writes whether
/// anybody reads it or not: it does not know of recordings, and never waits for one. A thread brings them
/// into the history, another from there to files; a disk may stand still for as long as the history is. Tells
/// events `recording`. Not RT safe; any thread but the servo's.
class Recordings {
 public:
  enum class Pace : std::uint8_t {
    threads,  ///< threads of its own: wall time
    manual,   ///< pump() is called at least every second of the loop's time; there is no flight recorder
  };

  /// Before the loop runs. Station and feed must outlive this. Throws std::system_error.
  Recordings(Runtime& runtime, EventFeed& feed, const Clock& clock, Pace pace = Pace::threads);
  /// What is there is written, and files are closed.
  ~Recordings();
  Recordings(const Recordings&) = delete;
  Recordings& operator=(const Recordings&) = delete;

  /// Writes every tick from now on to this file; `anywhere` lets it be an absolute path, else it is a name in
  /// directory(), and empty a name of the time. Returns the file. Throws RecordingError, also where one is
  /// written already.
  std::filesystem::path start(const std::string& asked, bool anywhere);
  /// The same to the very file, relative to the working directory, as the command line names it.
  void start_file(const std::filesystem::path& file);

  struct Summary {
    std::filesystem::path file;
    std::uint64_t ticks = 0;
    std::uint64_t lost = 0;  ///< ticks that are missing in it
  };
  /// Writes the rest and closes it. Nothing: none was written.
  std::optional<Summary> stop();

  /// What is in directory(), the oldest first; those that are being written are not.
  std::vector<StoredRecording> list() const;
  /// One of them, to be read. Throws RecordingError, also for one that is being written.
  OwnedFd open(const std::string& name) const;

  struct Status {
    std::optional<Summary> running;  ///< so far
    std::string failed;              ///< why the last one ended by itself; empty: it did not
    std::filesystem::path directory;
    double flight_s = 0.0;  ///< what the flight recorder holds; 0: there is none
    std::filesystem::path last_flight;
    std::uint64_t flights = 0;  ///< written since the start
  };
  /// Waits for nothing.
  Status status() const;

  void pump();

 private:
  struct Flight {
    std::filesystem::path file;
    Fault fault = Fault::none;
    std::int64_t from_ns = 0;
    std::int64_t until_ns = 0;
    TimePoint requested_at{};
    std::unique_ptr<Recorder> recorder;  ///< once it is written
    std::uint64_t end = 0;               ///< likewise: number of the first record beyond
  };

  void begin(const std::filesystem::path& file, const std::filesystem::path& directory);
  void collect_ticks();
  bool write(bool rest);
  bool write_running(bool rest);
  bool write_flight(bool rest);
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
  SharedState& state_;
  RecordHistory history_;

  std::mutex collect_mutex_;       ///< of what follows
  std::uint64_t next_record_ = 0;  ///< record of the shared memory to take
  std::uint64_t missed_ = 0;       ///< that were overwritten before they were taken
  StateRecord record_;

  std::mutex write_mutex_;  ///< of what follows
  std::unique_ptr<Recorder> running_;
  std::uint64_t missed_at_start_ = 0;  ///< as of its start

  mutable std::mutex status_mutex_;  ///< of what follows
  std::optional<Flight> flight_;
  Status status_;

  std::atomic<std::uint64_t> missed_total_{0};
  std::jthread collector_, writer_;  ///< last: they use all of the above
};

}  // namespace wrenchd
