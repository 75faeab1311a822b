// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/live_feed.hpp"

#include <cstring>
#include <stdexcept>
#include <utility>

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

constexpr auto kReconnectInterval = 300ms;  ///< interval between two attempts to connect
/// Reading interval with an open page; bounds the age of the ticks in a frame.
constexpr auto kWatchedInterval = 6ms;
constexpr auto kUnwatchedInterval =
    100ms;  ///< reading interval without a page; the shared memory retains 2 s
/// Interval for status values without events, such as tick durations. Lease changes have events.
constexpr auto kStatusInterval = 1s;
constexpr std::size_t kMaxEvents = 200;

/// Maps memory of another process for the lifetime of this object.
class MappedMemory {
 public:
  explicit MappedMemory(int descriptor) {
    struct stat file {};
    if (descriptor >= 0 && fstat(descriptor, &file) == 0) {
      bytes_ = static_cast<std::size_t>(file.st_size);
      memory_ = mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, descriptor, 0);
    }
    if (descriptor >= 0) close(descriptor);
    if (memory_ == MAP_FAILED) throw std::runtime_error("the geometry of the scene cannot be mapped");
  }
  ~MappedMemory() { munmap(memory_, bytes_); }
  MappedMemory(const MappedMemory&) = delete;
  MappedMemory& operator=(const MappedMemory&) = delete;
  std::span<const std::byte> bytes() const { return {static_cast<const std::byte*>(memory_), bytes_}; }

 private:
  void* memory_ = MAP_FAILED;
  std::size_t bytes_ = 0;
};

void pause(const std::stop_token& stop, std::chrono::milliseconds time) {
  for (const auto end = std::chrono::steady_clock::now() + time;
       !stop.stop_requested() && std::chrono::steady_clock::now() < end;)
    std::this_thread::sleep_for(std::min<std::chrono::milliseconds>(time, 20ms));
}

}  // namespace

LiveFeed::LiveFeed(std::string socket) : socket_(std::move(socket)) {
  link_.error = "connecting to wrenchd";
  reader_thread_ = std::jthread([this](const std::stop_token& stop) { run_reader(stop); });
  scene_thread_ = std::jthread([this](const std::stop_token& stop) { run_scene_fetcher(stop); });
}

LiveFeed::~LiveFeed() {
  reader_thread_.request_stop();
  scene_thread_.request_stop();
}

void LiveFeed::set_disconnected(const std::string& why) {
  connection_.store(0);
  const std::scoped_lock lock(mutex_);
  if (link_.connected || link_.error != why) ++link_.revision;
  link_.connected = false;
  link_.error = why;
}

void LiveFeed::run_reader(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    try {
      Client client(socket_);
      client.subscribe();
      StateReader reader = client.open_state();
      request_status(client);
      {
        const std::scoped_lock lock(mutex_);
        link_.connected = true;
        link_.error.clear();
        link_.rate_Hz = reader.rate_Hz();
        connection_.store(++link_.connection);
        ++link_.revision;
        history_ = MinMaxHistory(kBucket_ns, kBuckets);
        tick_duration_ = wake_latency_ = RollingHistogram{};
      }
      read_ticks(client, reader, stop);
    } catch (const ClientError& error) {
      set_disconnected(error.what());
    }
    pause(stop, kReconnectInterval);
  }
}

void LiveFeed::read_ticks(Client& client, StateReader& reader, const std::stop_token& stop) {
  TickState state;
  auto next_status = std::chrono::steady_clock::now() + kStatusInterval;
  while (!stop.stop_requested()) {
    bool any = false;
    while (reader.next(state, 0ms)) {
      any = true;
      const ViewTick tick = view_tick(tick_record(state));
      const ChannelValues values = tick.channels();
      const std::scoped_lock lock(mutex_);
      history_.add(tick.time_ns, values);
      tick_duration_.add(tick.time_ns, tick.duration_ns);
      wake_latency_.add(tick.time_ns, tick.wake_latency_ns);
    }
    if (any) {
      const TickRecord record = tick_record(state);
      Sample now{view_tick(record), view_status(record, state.contacts()), reader.missed()};
      rendering_id_.store(now.tick.rendering_id);
      const std::scoped_lock lock(mutex_);
      newest_sample_ = std::move(now);
    }
    bool status_due = std::chrono::steady_clock::now() >= next_status;
    ClientEvent event;
    while (client.poll_event(event, 0ms)) {
      status_due = status_due || event.name != "log";
      if (event.name == "reload") ++reloads_;
      const std::scoped_lock lock(mutex_);
      if (events_.size() < kMaxEvents) events_.push_back(event.json);
    }
    if (status_due) {
      request_status(client);
      next_status = std::chrono::steady_clock::now() + kStatusInterval;
    }
    std::this_thread::sleep_for(watched_.load() ? kWatchedInterval : kUnwatchedInterval);
  }
}

void LiveFeed::request_status(Client& client) {
  Json status = Json::parse(client.status());
  const std::scoped_lock lock(mutex_);
  if (status == link_.status) return;
  link_.status = std::move(status);
  ++link_.revision;
}

/// Fetches the scene after each connection, after each change of the rendering, and after a reload, which may
/// change the viewpoint.
void LiveFeed::run_scene_fetcher(const std::stop_token& stop) {
  std::uint64_t of_connection = 0;
  std::uint32_t of_rendering = 0, of_reload = 0;
  for (; !stop.stop_requested(); std::this_thread::sleep_for(30ms)) {
    const std::uint64_t connection = connection_.load();
    const std::uint32_t rendering = rendering_id_.load();
    const std::uint32_t reload = reloads_.load();
    if (connection == 0 || (connection == of_connection && rendering == of_rendering && reload == of_reload))
      continue;
    try {
      if (connection != of_connection) {
        const std::scoped_lock lock(mutex_);
        scene_ = nullptr;  // another daemon may use the same mesh numbers for other meshes
      }
      Client client(socket_, 60s);
      fetch_scene(client);
      of_connection = connection;
      of_rendering = rendering;
      of_reload = reload;
    } catch (const std::exception& error) {
      {
        const std::scoped_lock lock(mutex_);
        scene_error_ = error.what();
      }
      pause(stop, 1s);
    }
  }
}

void LiveFeed::fetch_scene(Client& client) {
  int descriptor = -1;
  const Json description = Json::parse(client.call("scene.geometry", "{}", descriptor));
  const MappedMemory memory(descriptor);
  const auto known = scene();
  auto made = std::make_shared<const ViewScene>(description, memory.bytes(), known.get());
  const std::scoped_lock lock(mutex_);
  scene_ = std::move(made);
  scene_error_.clear();
}

LiveFeed::Link LiveFeed::link() const {
  const std::scoped_lock lock(mutex_);
  return link_;
}

std::optional<LiveFeed::Sample> LiveFeed::newest_sample() const {
  const std::scoped_lock lock(mutex_);
  return newest_sample_;
}

std::shared_ptr<const ViewScene> LiveFeed::scene() const {
  const std::scoped_lock lock(mutex_);
  return scene_;
}

std::string LiveFeed::scene_error() const {
  const std::scoped_lock lock(mutex_);
  return scene_error_;
}

RollingHistogram::Summary LiveFeed::tick_duration() const {
  const std::scoped_lock lock(mutex_);
  return tick_duration_.summary();
}

RollingHistogram::Summary LiveFeed::wake_latency() const {
  const std::scoped_lock lock(mutex_);
  return wake_latency_.summary();
}

void LiveFeed::with_history(const std::function<void(const MinMaxHistory&)>& visit) const {
  const std::scoped_lock lock(mutex_);
  visit(history_);
}

std::vector<std::string> LiveFeed::events() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(events_, {});
}

std::string LiveFeed::state() const {
  const std::scoped_lock lock(mutex_);
  return newest_sample_ ? newest_sample_->words.state : std::string();
}

}  // namespace wrenchd
