// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/control/event_feed.hpp"
#include "daemon/recording/recorded_event.hpp"

namespace wrenchd {

/// Takes the events for one recording from the event feed. The feed must outlive this object. Not RT-safe:
/// allocates, locks.
class EventLog {
 public:
  /// The events of other threads carry the monotonic time, which is not the time of the ticks in virtual
  /// time.
  enum class EmittedTime : std::uint8_t { as_stated, of_newest_tick };

  /// first: sequence number of the first event to take. from_ns: earlier events are left out.
  EventLog(const EventFeed& feed, std::uint64_t first, std::int64_t from_ns, EmittedTime emitted)
      : feed_(feed), next_(first), from_ns_(from_ns), emitted_(emitted) {}

  /// Returns the events until this time, in the order of the feed. Later events remain for the next call, so
  /// that their tick is stored by then. If the feed dropped events, an event "events_lost" tells how many.
  std::vector<RecordedEvent> take(std::int64_t until_ns);
  /// Returns all events. newest_ns: time of the newest tick.
  std::vector<RecordedEvent> take_all(std::int64_t newest_ns);

 private:
  std::vector<RecordedEvent> take(std::int64_t newest_ns, bool all);

  const EventFeed& feed_;
  std::uint64_t next_;
  std::int64_t from_ns_;
  EmittedTime emitted_;
};

}  // namespace wrenchd
