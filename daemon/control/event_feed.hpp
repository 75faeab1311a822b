// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fault.hpp"
#include "core/state.hpp"
#include "daemon/control/event_description.hpp"
#include "daemon/control/fault_repeats.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/servo/event.hpp"
#include "daemon/thread_guard.hpp"

namespace wrenchd {

class ServoLoop;

/// A kind of event, as listed by `describe`.
struct EventRow {
  std::string name;
  std::string doc;  ///< when the event is emitted, and its fields
};

/// State of the daemon after the event `sequence`. A client that applies all later events to the snapshot
/// knows the present state.
struct FeedSnapshot {
  std::uint64_t sequence = 0;  ///< of the last event that is in it; 0: none yet
  State state = State::disconnected;
  Fault cause = Fault::none;
  Fault last_fault = Fault::none;  ///< newest fault that changed the state; none: there was no such fault
  TimePoint last_fault_at{};       ///< when last_fault was raised
  /// Other faults of the ten seconds before the cause of a fault, the newest first, at most three. They often
  /// are its reason. Empty for a stop.
  std::vector<Fault> before_cause;
  std::string proxy_initialization = "unknown";  ///< "searching", "found" or "failed"
  std::uint32_t held_body = 0;                   ///< number of the body that the tool holds, from 1; 0: none
  double stiffness_scale = 1.0;                  ///< stable fraction of the configured stiffness, 0 to 1
};

/// An event as the feed stores it.
struct FeedEvent {
  TimePoint at{};
  bool by_loop = false;  ///< true: emitted by the servo thread, so `at` is the start of a tick
  std::string name;
  EventLevel level = EventLevel::info;
  std::string text;
  Json fields;       ///< an object: what the event says to programs
  std::string line;  ///< notification for subscribers, with its '\n'
};

/// Numbers and logs the events of the daemon, and stores the newest for subscribers. A thread of its own
/// reads the event ring of the servo thread. Every other thread calls emit(). Not RT-safe: allocates, locks,
/// logs.
class EventFeed {
 public:
  /// hand: its log lines begin with this name; empty: the first hand, which has none.
  explicit EventFeed(ServoLoop& loop, std::string hand = {});
  /// Publishes the events that are left in the ring.
  ~EventFeed();
  EventFeed(const EventFeed&) = delete;
  EventFeed& operator=(const EventFeed&) = delete;

  /// Publishes an event, and returns its time. fields: an object, whose members are added to those of every
  /// event.
  TimePoint emit(const std::string& name, EventLevel level, const std::string& text,
                 const Json& fields = Json::object());

  /// Called for each fault that latches or releases the hand, before the fault is published. Returns the file
  /// that will hold the ticks before the fault; empty: none. The event names this file. Runs on the thread of
  /// the feed, and must not call the feed.
  using RecordFault = std::function<std::string(Fault fault, TimePoint at)>;
  void set_fault_recorder(RecordFault kept_in);

  /// Publishes the events that are in the ring of the servo thread now. Any thread except the servo thread.
  void drain();

  FeedSnapshot snapshot() const;

  struct Batch {
    std::vector<std::string> lines;  ///< notifications, each with its '\n'
    std::uint64_t next = 0;          ///< first sequence number of the next batch
    std::uint64_t lost = 0;          ///< events of any name that left the history before they were read
    bool more = false;               ///< max_bytes was too small for all events
  };
  /// Returns events from this sequence number on that have one of these names (empty: all), up to max_bytes.
  Batch events_since(std::uint64_t next, const std::set<std::string>& names, std::size_t max_bytes) const;

  struct Stored {
    std::vector<FeedEvent> events;
    std::uint64_t lost = 0;  ///< events that left the history before they were read
  };
  /// Returns all stored events from this sequence number on, with what a recording needs.
  Stored stored_since(std::uint64_t next) const;

  /// Sets the eventfd that the feed writes to with each event; -1: none. It must stay open until it is unset.
  void set_wake_fd(int eventfd);

  /// Number of events in the history.
  static constexpr std::size_t kHistorySize = 1024;

 private:
  void publish(const Event& event);
  enum class Source : std::uint8_t { loop, other };
  void append(TimePoint at, const std::string& name, EventLevel level, const std::string& text,
              const Json& fields, Source source = Source::loop);
  std::vector<Fault> faults_before(State state, Fault cause, TimePoint at) const;
  void append_held_back_faults(TimePoint at, Source source);
  void append_device_event(TimePoint at, State from, State to);

  ServoLoop& loop_;
  const std::string hand_;
  std::mutex drain_mutex_;              ///< the ring permits one reader at a time
  std::uint64_t dropped_reported_ = 0;  ///< dropped events that were reported
  bool device_was_present_ = false;
  RecordFault record_fault_;
  FaultRepeats fault_repeats_;  ///< protected by drain_mutex_
  /// The newest first, also those that changed no state; protected by drain_mutex_.
  std::deque<std::pair<TimePoint, Fault>> recent_faults_;
  ThreadGuard record_guard_{"flight recorder"};  ///< protected by drain_mutex_

  mutable std::mutex mutex_;       ///< protects history_, snapshot_ and wake_fd_
  std::deque<FeedEvent> history_;  ///< the last event has the number snapshot_.sequence
  FeedSnapshot snapshot_;
  int wake_fd_ = -1;

  std::jthread thread_;  ///< last member: it uses the members above
};

/// Returns the kinds of events that the feed publishes. Not RT-safe: allocates at the first call.
std::span<const EventRow> feed_events();

}  // namespace wrenchd
