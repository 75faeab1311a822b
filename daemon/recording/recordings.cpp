// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recordings.hpp"

#include <chrono>
#include <cmath>
#include <utility>

#include <pthread.h>

#include "core/files/absolute_name.hpp"
#include "daemon/hand_file.hpp"
#include "daemon/recording/recording_directory.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// Time between two readings of the shared memory, which stores the last two seconds.
constexpr auto kCollectPeriod = 20ms;
constexpr auto kWritePeriod = 100ms;
/// Duration after a fault that the flight recorder writes.
constexpr Duration kAfterFault = 1s;
/// Longest wait for the ticks after a fault. A loop that has ended or stalled produces none.
constexpr Duration kMaxTickWait = 2500ms;
/// The history exceeds flight_s by kAfterFault and by the largest delay of the writer.
constexpr double kMargin_s = 4.0;
/// Shortest history: the longest pause of the disk that loses no tick.
constexpr double kMinHistory_s = 10.0;

std::size_t history_ticks(double flight_s, double rate_Hz) {
  return static_cast<std::size_t>(std::ceil(std::max(flight_s + kMargin_s, kMinHistory_s) * rate_Hz));
}

std::time_t utc_now() {
  return std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
}

}  // namespace

Recordings::Recordings(Runtime& runtime, EventFeed& feed, const Clock& clock, Pace pace)
    : runtime_(runtime),
      feed_(feed),
      clock_(clock),
      settings_(runtime.config().settings.recording),
      directory_(recordings_directory(settings_)),
      flight_s_(pace == Pace::threads ? settings_.flight_s : 0.0),
      emitted_time_(pace == Pace::threads ? EventLog::EmittedTime::as_stated
                                          : EventLog::EmittedTime::of_newest_tick),
      state_(runtime.enable_shared_state()),
      history_(history_ticks(flight_s_, state_.rate_Hz())) {
  status_.directory = directory_;
  status_.flight_s = flight_s_;
  if (pace == Pace::manual) return;
  if (flight_s_ > 0.0)
    feed_.set_fault_recorder([this](Fault fault, TimePoint at) { return begin_flight(fault, at); });
  collector_ = std::jthread([this](const std::stop_token& stop) {
    pthread_setname_np(pthread_self(), "record take");
    ThreadGuard guard("recorder of ticks");
    for (; !stop.stop_requested(); std::this_thread::sleep_for(kCollectPeriod))
      guard.run([this] { collect_ticks(); });
  });
  writer_ = std::jthread([this](const std::stop_token& stop) {
    pthread_setname_np(pthread_self(), "record write");
    ThreadGuard guard("writer of recordings");
    for (; !stop.stop_requested(); std::this_thread::sleep_for(kWritePeriod))
      guard.run([&] {
        while (write(false) && !stop.stop_requested()) {
        }
      });
  });
}

Recordings::~Recordings() {
  close();
}

void Recordings::close() noexcept {
  close_guard_.run([this] { feed_.drain(); });  // a fault of the last ticks still begins its flight
  feed_.set_fault_recorder({});
  for (std::jthread* thread : {&collector_, &writer_})
    if (thread->joinable()) {
      thread->request_stop();
      thread->join();
    }
  close_guard_.run([this] { collect_ticks(); });
  close_guard_.run([this] {
    while (write_flight(true)) {
    }
  });
  close_guard_.run([this] {
    stop();
    const std::scoped_lock lock(write_mutex_);
    closed_ = true;
  });
}

std::filesystem::path Recordings::start(const std::string& requested, bool anywhere) {
  const std::string name = requested.empty() ? "run-" + utc_stamp(utc_now()) : requested;
  const std::filesystem::path file =
      file_of_hand(recording_path(name, directory_, anywhere), runtime_.config().hand());
  if (file.parent_path() == directory_) make_recordings_directory(directory_);
  begin(file, file.parent_path());
  return file;
}

void Recordings::start_file(const std::filesystem::path& file) {
  // The working directory may be removed while the recording runs.
  const std::filesystem::path given = absolute_name(file);
  std::error_code error;
  const std::filesystem::path directory = std::filesystem::weakly_canonical(given.parent_path(), error);
  const std::filesystem::path absolute = error ? given : directory / given.filename();
  begin(absolute, absolute.parent_path());
}

void Recordings::begin(const std::filesystem::path& file, const std::filesystem::path& directory) {
  if (is_flight_name(file.filename().string(), runtime_.config().hand()))
    throw RecordingError(file.string() +
                         ": has the name of a file of the flight recorder, which removes its old files; "
                         "choose another name");
  const RecordingHeader header = runtime_.recording_header();
  collect_ticks();
  const std::scoped_lock lock(write_mutex_);
  if (closed_) throw RecordingError(file.string() + ": no recording can start, because the daemon ends");
  if (running_)
    throw RecordingError(running_->file().string() + ": a recording is already running; stop it first");
  std::error_code ignored;
  if (std::filesystem::is_directory(directory, ignored)) check_free_space(directory, settings_);
  running_ = std::make_unique<Recorder>(history_, file, header, history_.stored_range().end);
  running_events_ =
      std::make_unique<EventLog>(feed_, feed_.snapshot().sequence + 1, header.started_ns, emitted_time_);
  running_directory_ = directory;
  missed_at_start_ = missed_total_.load();
  {
    const std::scoped_lock status(status_mutex_);
    status_.failed.clear();
  }
  publish();
  feed_.emit("recording", EventLevel::info, "recording: " + file.string(),
             {{"phase", "started"}, {"file", file.string()}});
}

std::optional<Recordings::Summary> Recordings::stop() {
  collect_ticks();
  feed_.drain();
  const std::scoped_lock lock(write_mutex_);
  if (!running_) return {};
  try {
    while (running_ && running_->write_next(history_.stored_range().end, true)) {
    }
    write_events(*running_, *running_events_, true);
  } catch (const std::exception& error) {
    fail(error.what());
    return {};
  }
  return finish();
}

/// Precondition: write_mutex_ is locked.
Recordings::Summary Recordings::finish() {
  const Summary written{running_->file(), running_->written(),
                        running_->lost() + missed_total_.load() - missed_at_start_};
  running_.reset();
  publish();
  std::string text = "recorded: " + written.file.string() + ", " + std::to_string(written.ticks) + " ticks";
  if (written.lost > 0) text += "; " + std::to_string(written.lost) + " are missing: the disk fell behind";
  feed_.emit("recording", written.lost > 0 ? EventLevel::warning : EventLevel::info, text,
             {{"phase", "ended"},
              {"file", written.file.string()},
              {"ticks", written.ticks},
              {"lost", written.lost}});
  return written;
}

/// Ends the recording after an error, and keeps its file. Precondition: write_mutex_ is locked.
void Recordings::fail(const std::string& why) {
  const std::filesystem::path file = running_->file();
  const std::uint64_t ticks = running_->written();
  running_.reset();
  {
    const std::scoped_lock status(status_mutex_);
    status_.failed = why;
  }
  publish();
  feed_.emit("recording", EventLevel::error,
             "the recording has ended after " + std::to_string(ticks) + " ticks: " + why,
             {{"phase", "failed"}, {"file", file.string()}, {"ticks", ticks}, {"reason", why}});
}

Recordings::Status Recordings::status() const {
  const std::scoped_lock status(status_mutex_);
  return status_;
}

bool Recordings::is_being_written(const std::filesystem::path& file) const {
  const std::scoped_lock status(status_mutex_);
  return (status_.running && status_.running->file == file) || (flight_ && flight_->file == file);
}

std::vector<StoredRecording> Recordings::list() const {
  std::vector<StoredRecording> found = stored_recordings(directory_);
  std::erase_if(found,
                [this](const StoredRecording& one) { return is_being_written(directory_ / one.name); });
  return found;
}

OwnedFd Recordings::open(const std::string& name) const {
  const std::filesystem::path file = recording_path(name, directory_, false);
  if (is_being_written(file))
    throw RecordingError(file.string() +
                         ": is incomplete; 'record.stop' ends a recording, and an event 'recording' reports "
                         "when a flight is complete");
  return open_recording(directory_, name);
}

/// Precondition: write_mutex_ is locked.
void Recordings::publish() {
  const std::scoped_lock status(status_mutex_);
  status_.running.reset();
  if (running_)
    status_.running = Summary{running_->file(), running_->written(),
                              running_->lost() + missed_total_.load() - missed_at_start_};
}

void Recordings::pump() {
  collect_ticks();
  while (write(false)) {
  }
}

/// Copies the new ticks from the shared memory to the history.
void Recordings::collect_ticks() {
  const std::scoped_lock lock(collect_mutex_);
  const std::uint64_t written = state_.written();
  while (next_record_ < written) {
    if (state_.read(next_record_, record_)) {
      history_.append(record_);
      ++next_record_;
      continue;
    }
    const std::uint64_t oldest = state_.written() - std::min(state_.written(), state_.slots() / 2);
    // Skip half of the ring, so that the writer does not overtake the reader again at once.
    const std::uint64_t from = std::max(oldest, next_record_ + 1);
    missed_ += from - next_record_;
    next_record_ = from;
    missed_total_.store(missed_);
  }
}

/// Returns true if there may be more to write at once.
bool Recordings::write(bool rest) {
  const bool more = write_running(rest);
  check_disk_space();
  return write_flight(rest) || more;
}

bool Recordings::write_running(bool rest) {
  const std::scoped_lock lock(write_mutex_);
  if (!running_) return false;
  try {
    const bool more = running_->write_next(history_.stored_range().end, rest);
    write_events(*running_, *running_events_, false);
    publish();
    return more;
  } catch (const std::exception& error) {
    fail(error.what());
  }
  return false;
}

/// Writes the events up to the newest tick; all: every event.
void Recordings::write_events(Recorder& recorder, EventLog& log, bool all) {
  const std::int64_t newest_ns = history_.newest_ns();
  std::vector<RecordedEvent> events = all ? log.take_all(newest_ns) : log.take(newest_ns);
  recorder.write_events(events);
}

std::optional<Recordings::Marked> Recordings::mark(const std::string& label, const Json& conditions) {
  check_marker(label, conditions);
  const auto running = status().running;
  if (!running) return {};
  {
    const std::scoped_lock lock(marker_mutex_);
    if (!marker_rate_.admit(clock_.now()))
      throw RecordingError("more than " + std::to_string(static_cast<int>(MarkerRate::kPerSecond)) +
                           " markers per second; mark less often");
  }
  const TimePoint at =
      feed_.emit("marker", EventLevel::info, label, {{"label", label}, {"conditions", conditions}});
  return Marked{running->file, at.time_since_epoch().count()};
}

/// Ends the recording if the free space falls below keep_free_MB. Runs after each piece, because other
/// programs may fill the disk at any time.
void Recordings::check_disk_space() {
  const std::scoped_lock lock(write_mutex_);
  if (!running_) return;
  try {
    check_free_space(running_directory_, settings_);
  } catch (const std::exception& error) {
    fail(error.what());
  }
}

/// Returns the file for a fault. The writer creates it when kAfterFault has passed. Faults until then are
/// recorded in the same file. Called on the thread of the event feed.
std::string Recordings::begin_flight(Fault fault, TimePoint at) {
  if (directory_.empty()) return {};
  const std::scoped_lock status(status_mutex_);
  if (flight_) return flight_->recorder ? std::string() : flight_->file.string();
  const auto ago = std::chrono::duration_cast<std::chrono::seconds>(clock_.now() - at);
  Flight flight;
  flight.file =
      flight_path(directory_, utc_now() - ago.count(), fault_row(fault).name, runtime_.config().hand());
  flight.fault = fault;
  // The number is taken now: until the writer begins, ticks may leave the history, and then they are counted.
  flight.from_ns = (at - from_seconds(flight_s_)).time_since_epoch().count();
  flight.first = history_.first_at_or_after(flight.from_ns);
  flight.missed_before = missed_total_.load();
  flight.until_ns = (at + kAfterFault).time_since_epoch().count();
  flight.requested_at = std::chrono::steady_clock::now();
  flight_ = std::move(flight);
  return flight_->file.string();
}

/// Writes a piece of the flight. rest: no more ticks will arrive. Returns true if there is more to write.
bool Recordings::write_flight(bool rest) {
  std::unique_lock status(status_mutex_);
  if (!flight_) return false;
  Flight& flight = *flight_;
  const bool over = rest || std::chrono::steady_clock::now() - flight.requested_at > kMaxTickWait;
  if (!flight.recorder && !over && history_.newest_ns() < flight.until_ns) return false;
  status.unlock();  // only this thread changes a flight that has begun
  try {
    if (!flight.recorder) {
      make_recordings_directory(directory_);
      check_free_space(directory_, settings_);
      prune_flights(directory_, static_cast<std::size_t>(settings_.flights_kept - 1),
                    runtime_.config().hand());
      const RecordingHeader header = runtime_.recording_header();
      flight.end = history_.first_at_or_after(flight.until_ns + 1);
      auto recorder = std::make_unique<Recorder>(history_, flight.file, header, flight.first);
      status.lock();
      flight.recorder = std::move(recorder);
      status.unlock();
    }
    if (flight.recorder->write_next(flight.end, true)) return true;
    EventLog log(feed_, 1, flight.from_ns, emitted_time_);
    std::vector<RecordedEvent> events = log.take(flight.until_ns);
    flight.recorder->write_events(events);
    end_flight({});
  } catch (const std::exception& error) {
    end_flight(error.what());
  }
  return false;
}

void Recordings::end_flight(const std::string& why) {
  const std::filesystem::path file = flight_->file;
  const Fault fault = flight_->fault;
  const std::uint64_t ticks = flight_->recorder ? flight_->recorder->written() : 0;
  const std::uint64_t lost =
      flight_->recorder ? flight_->recorder->lost() + missed_total_.load() - flight_->missed_before : 0;
  if (flight_->recorder && !why.empty()) {  // a reader would take an incomplete file for a complete one
    flight_->recorder.reset();
    std::error_code ignored;
    std::filesystem::remove(file, ignored);
  }
  {
    const std::scoped_lock status(status_mutex_);
    flight_.reset();
    if (why.empty()) {
      status_.last_flight = file;
      ++status_.flights;
    }
  }
  const std::string name(fault_row(fault).name);
  if (why.empty())
    feed_.emit(
        "recording", lost > 0 ? EventLevel::warning : EventLevel::info,
        "flight recorder: the ticks before " + name + " are in " + file.string() + ", " +
            std::to_string(ticks) + " ticks" +
            (lost > 0 ? "; " + std::to_string(lost) + " are missing: the writer fell behind" : ""),
        {{"phase", "flight"}, {"file", file.string()}, {"ticks", ticks}, {"lost", lost}, {"fault", name}});
  else
    feed_.emit("recording", EventLevel::error,
               "flight recorder: the ticks before " + name + " are lost: " + why,
               {{"phase", "failed"}, {"file", file.string()}, {"reason", why}, {"fault", name}});
}

}  // namespace wrenchd
