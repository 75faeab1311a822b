// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/event_log.hpp"

#include <array>

namespace wrenchd {
namespace {

/// Members of an event that are its number, in the order of precedence.
constexpr std::array kNumberKeys = {"value", "scale", "distance_m", "rendering_id"};

RecordedEvent recorded(const FeedEvent& event, std::int64_t time_ns) {
  RecordedEvent to;
  to.time_ns = time_ns;
  to.severity = event.level;
  to.name = event.name;
  to.text = event.text;
  for (const char* const key : kNumberKeys)
    if (const auto number = event.fields.find(key); number != event.fields.end() && number->is_number()) {
      to.value = number->get<double>();
      break;
    }
  if (const auto conditions = event.fields.find("conditions");
      conditions != event.fields.end() && conditions->is_object() && !conditions->empty())
    to.conditions = conditions->dump();
  return to;
}

}  // namespace

std::vector<RecordedEvent> EventLog::take(std::int64_t until_ns) {
  return take(until_ns, false);
}

std::vector<RecordedEvent> EventLog::take_all(std::int64_t newest_ns) {
  return take(newest_ns, true);
}

std::vector<RecordedEvent> EventLog::take(std::int64_t newest_ns, bool all) {
  std::vector<RecordedEvent> taken;
  const EventFeed::Stored stored = feed_.stored_since(next_);
  if (stored.lost > 0) {
    RecordedEvent lost;
    lost.time_ns = newest_ns;
    lost.severity = EventLevel::warning;
    lost.name = "events_lost";
    lost.text = std::to_string(stored.lost) + " events are missing: the writer of the recording fell behind";
    lost.value = static_cast<double>(stored.lost);
    taken.push_back(lost);
    next_ += stored.lost;
  }
  for (const FeedEvent& event : stored.events) {
    const bool restamp = emitted_ == EmittedTime::of_newest_tick && !event.by_loop;
    const std::int64_t time_ns = restamp ? newest_ns : event.at.time_since_epoch().count();
    if (!all && time_ns > newest_ns) break;
    ++next_;
    if (time_ns >= from_ns_) taken.push_back(recorded(event, time_ns));
  }
  return taken;
}

}  // namespace wrenchd
