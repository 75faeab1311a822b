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
#include <vector>

#include "core/fault.hpp"
#include "core/state.hpp"
#include "daemon/control/event_description.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/servo/event.hpp"

namespace wrenchd {

class ServoLoop;

/// A kind of event, as `describe` tells it.
struct EventRow {
  std::string name;
  std::string doc;  ///< when it comes, and its fields
};

/// What the events up to a sequence number come to: who has this and applies all later events to it knows
/// what the daemon knows.
struct FeedSnapshot {
  std::uint64_t sequence = 0;  ///< of the last event that is in it; 0: none yet
  State state = State::disconnected;
  Fault cause = Fault::none;
  std::string proxy_initialization = "unknown";  ///< "seeking", "placed", "nowhere"
  double stiffness_scale = 1.0;                  ///< of the spring asked for that the device bears
};

/// News of the daemon: each gets a sequence number, is logged, and is kept for a while for whoever listens.
/// Takes the servo thread's from its ring, on a thread of its own, and those of any other thread but the
/// servo's. Not RT safe.
class EventFeed {
 public:
  explicit EventFeed(ServoLoop& loop);
  /// Logs what is still in the ring.
  ~EventFeed();
  EventFeed(const EventFeed&) = delete;
  EventFeed& operator=(const EventFeed&) = delete;

  /// fields: an object; its members are added to those that every event has.
  void emit(const std::string& name, EventLevel level, const std::string& text,
            const Json& fields = Json::object());

  /// Asked about each fault that latches or lets go of the hand, before it is told: the file that will show
  /// what led to it, which the event then names; empty: none. From the feed's thread; must not come back
  /// here.
  using RecordFault = std::function<std::string(Fault fault, TimePoint at)>;
  void set_fault_recorder(RecordFault kept_in);

  /// Takes what is in the servo thread's ring now. Any thread but the servo's.
  void drain();

  FeedSnapshot snapshot() const;

  struct Batch {
    std::vector<std::string> lines;  ///< notifications, each with its '\n'
    std::uint64_t next = 0;          ///< what to ask for next time
    std::uint64_t lost = 0;          ///< events that are kept no longer, of any name
    bool more = false;               ///< there was no room for all
  };
  /// Events from that sequence number on, of these names (none given: all), until they are max_bytes long.
  Batch events_since(std::uint64_t next, const std::set<std::string>& names, std::size_t max_bytes) const;

  /// An eventfd that is written to with each event; -1: nobody listens. Must stay open until it is unset.
  void set_wake_fd(int eventfd);

  /// How many are kept.
  static constexpr std::size_t kHistorySize = 1024;

 private:
  struct StoredEvent {
    std::string name;
    std::string line;
  };

  void publish(const Event& event);
  void append(TimePoint at, const std::string& name, EventLevel level, const std::string& text,
              const Json& fields);
  void append_device_event(TimePoint at, State from, State to);

  ServoLoop& loop_;
  std::mutex drain_mutex_;  ///< the ring has one reader at a time
  std::uint64_t dropped_reported_ = 0;
  bool device_was_present_ = false;
  RecordFault record_fault_;

  mutable std::mutex mutex_;         ///< of all that follows
  std::deque<StoredEvent> history_;  ///< the last is the one of now_.sequence
  FeedSnapshot snapshot_;
  int wake_fd_ = -1;

  std::jthread thread_;  ///< last: it uses all of the above
};

/// The events that come from here. `describe` lists them.
std::span<const EventRow> feed_events();

}  // namespace wrenchd
