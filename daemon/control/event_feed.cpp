// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/event_feed.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/control/event_description.hpp"
#include "daemon/event_journal.hpp"
#include "daemon/log_prefix.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

constexpr auto kPause = std::chrono::milliseconds(10);

spdlog::level::level_enum log_level(EventLevel level) {
  switch (level) {
    case EventLevel::info:
      return spdlog::level::info;
    case EventLevel::warning:
      return spdlog::level::warn;
    case EventLevel::error:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

/// Number of faults that the feed remembers, and largest number and largest age of those that it names beside
/// the cause of a fault.
constexpr std::size_t kRecentFaults = 16, kMostBefore = 3;
constexpr std::chrono::seconds kBefore{10};

/// Applies an event to what clients know of the loop.
void apply(FeedSnapshot& snapshot, const Event& event, const EventDescription& description) {
  if (const auto* state = std::get_if<Event::StateChanged>(&event.data)) {
    snapshot.state = state->state;
    snapshot.cause = state->cause;
    if (state->state == State::self_test) snapshot.stiffness_scale = 1.0;  // the self-test measures it again
  }
  if (const auto* raised = std::get_if<Event::FaultRaised>(&event.data);
      raised != nullptr && raised->changed_state) {
    snapshot.last_fault = raised->fault;
    snapshot.last_fault_at = event.at;
  }
  if (const auto* grasped = std::get_if<Event::Grasped>(&event.data)) snapshot.held_body = grasped->body;
  if (std::holds_alternative<Event::LetGo>(event.data)) snapshot.held_body = 0;
  if (const auto* stiffness = std::get_if<Event::StiffnessScaled>(&event.data))
    snapshot.stiffness_scale = stiffness->scale;
  if (description.name == "proxy_initialization" &&
      !std::holds_alternative<Event::ProjectionInfeasible>(event.data))
    snapshot.proxy_initialization = description.fields["outcome"].get<std::string>();
}

}  // namespace

std::span<const EventRow> feed_events() {
  static const std::array<EventRow, 13> rows = {{
      {"state", "The loop entered another state. state: its name; cause: the fault that led to it, or null."},
      {"fault",
       "A fault was raised. fault: name, message and cure; value: its measured size, or 0; recording: the "
       "flight recording of the ticks before it, if one was kept. A fault that changes no state is published "
       "once in 60 s; repeats: how often it was raised in between."},
      {"device",
       "A device was connected or disconnected. present: a device is connected; reconnected: one was "
       "connected before."},
      {"stiffness",
       "The self-test, or another rendering, has changed the share of the configured stiffness that stays "
       "passive. scale: this share; null: the profile states no damping, so the stability bound is unknown."},
      {"grasp",
       "The tool holds a free body, or has let go of it. body: its number, from 1 in the order of the scene; "
       "held; broke: its load was larger than the strength of the grasp."},
      {"external_wrench",
       "A program begins to act on the hand by method 'wrench.set'. source: who it is. The records of the "
       "ticks have its wrench."},
      {"arming_rejected", "A request to arm was rejected. state: the state that does not allow it."},
      {"proxy_initialization",
       "The search for a feasible pose of the tool, after each arming. outcome: searching, found "
       "(distance_m: from the "
       "hand), failed, projection_infeasible."},
      {"waits",
       "An armed loop or a self-test has waited for a second for the same condition. reason: no_report, "
       "not_homed, fault, "
       "proxy_search, no_room, handle_moves, handle_turns, contact_pushes, contact_twists; fault: the fault "
       "that repeats, or "
       "null; value, limit: what the condition compares, in SI units. Method 'status' has the present "
       "numbers."},
      {"released", "The hand was released: zero wrench, motors off."},
      {"scene",
       "Another rendering replaces the active one. rendering_id: its number, as in the tick record; "
       "crossfade_complete: "
       "false when the crossfade begins, true when it ends."},
      {"reload",
       "The configuration was reloaded. applied, not_applied: keys; error: why it was rejected, or null."},
      {"log", "Any other log line."},
  }};
  return rows;
}

EventFeed::EventFeed(ServoLoop& loop, std::string hand)
    : loop_(loop), hand_(std::move(hand)), thread_([this](const std::stop_token& stop) {
        ThreadGuard guard("event feed");
        while (!stop.stop_requested()) {
          guard.run([this] { drain(); });
          std::this_thread::sleep_for(kPause);
        }
        guard.run([this] { drain(); });
        guard.run([this] {
          const std::scoped_lock lock(drain_mutex_, mutex_);
          append_held_back_faults(std::chrono::steady_clock::now(), Source::other);
        });
      }) {}

EventFeed::~EventFeed() {
  thread_.request_stop();
  thread_.join();
}

TimePoint EventFeed::emit(const std::string& name, EventLevel level, const std::string& text,
                          const Json& fields) {
  const std::scoped_lock lock(mutex_);
  const TimePoint at = std::chrono::steady_clock::now();
  append(at, name, level, text, fields, Source::other);
  return at;
}

/// Precondition: mutex_ is locked, so that snapshot and sequence number change together.
void EventFeed::append(TimePoint at, const std::string& name, EventLevel level, const std::string& text,
                       const Json& fields, Source source) {
  Json params = {{"sequence", ++snapshot_.sequence},
                 {"time_ns", at.time_since_epoch().count()},
                 {"name", name},
                 {"level", wrenchd::name(level)},
                 {"text", text}};
  for (const auto& [key, value] : fields.items()) params[key] = value;
  history_.push_back(
      {at, source == Source::loop, name, level, text, fields, notification_line("event", params)});
  if (history_.size() > kHistorySize) history_.pop_front();
  const LogPrefix prefix(hand_);
  spdlog::log(log_level(level), "{}", text);
  if (wake_fd_ < 0) return;
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_fd_, &one, sizeof one);  // full is awake
}

void EventFeed::set_fault_recorder(RecordFault recorded_in) {
  const std::scoped_lock draining(drain_mutex_);
  record_fault_ = std::move(recorded_in);
}

void EventFeed::publish(const Event& event) {
  EventDescription description = describe(event);
  if (const auto* raised = std::get_if<Event::FaultRaised>(&event.data)) {
    recent_faults_.emplace_front(event.at, raised->fault);
    if (recent_faults_.size() > kRecentFaults) recent_faults_.pop_back();
    if (!raised->changed_state) {
      const auto repeats = fault_repeats_.admit(raised->fault, event.at);
      if (!repeats) return;
      description.fields["repeats"] = *repeats;
      if (*repeats > 0) description.text += fmt::format("; raised {} more times before", *repeats);
    }
    std::string recording;
    if (is_severe(raised->fault) && record_fault_)
      record_guard_.run([&] { recording = record_fault_(raised->fault, event.at); });
    if (!recording.empty()) {
      description.fields["recording"] = recording;
      description.text += "; recorded in " + recording;
    }
  }
  const std::scoped_lock lock(mutex_);
  const JournalFields fields(journal_fields(event));
  if (std::holds_alternative<Event::StateChanged>(event.data))
    append_held_back_faults(event.at, Source::loop);
  const State from = snapshot_.state;
  apply(snapshot_, event, description);
  if (std::holds_alternative<Event::StateChanged>(event.data))
    snapshot_.before_cause = faults_before(snapshot_.state, snapshot_.cause, event.at);
  append(event.at, description.name, description.level, description.text, description.fields);
  if (const auto* state = std::get_if<Event::StateChanged>(&event.data))
    append_device_event(event.at, from, state->state);
}

/// Returns FeedSnapshot::before_cause of a state that was entered at this time. Precondition: drain_mutex_ is
/// locked.
std::vector<Fault> EventFeed::faults_before(State state, Fault cause, TimePoint at) const {
  std::vector<Fault> before;
  if (cause == Fault::none || state == State::stopped) return before;
  for (const auto& [raised_at, fault] : recent_faults_) {
    const bool known = fault == cause || std::find(before.begin(), before.end(), fault) != before.end();
    if (!known && at - raised_at <= kBefore && before.size() < kMostBefore) before.push_back(fault);
  }
  return before;
}

/// Publishes how often faults were raised that changed no state. Precondition: drain_mutex_ and mutex_ are
/// locked.
void EventFeed::append_held_back_faults(TimePoint at, Source source) {
  for (const auto& [fault, count] : fault_repeats_.take())
    append(at, "fault", EventLevel::warning,
           fmt::format("{}: raised {} more times until now, without an effect", fault_row(fault).name, count),
           {{"fault", fault_json(fault)}, {"value", 0.0}, {"repeats", count}}, source);
}

/// The states show whether a device came or went, on every kind of link.
void EventFeed::append_device_event(TimePoint at, State from, State to) {
  if (from == State::disconnected && to != State::shutdown) {
    append(at, "device", EventLevel::info, device_was_present_ ? "device reconnected" : "device connected",
           {{"present", true}, {"reconnected", device_was_present_}});
    device_was_present_ = true;
  } else if (to == State::disconnected) {
    append(at, "device", EventLevel::warning, "device disconnected",
           {{"present", false}, {"reconnected", device_was_present_}});
  }
}

void EventFeed::drain() {
  const std::scoped_lock draining(drain_mutex_);
  Event event;
  while (loop_.telemetry().events().pop(event)) publish(event);
  const std::uint64_t dropped = loop_.telemetry().dropped_events();
  if (dropped == dropped_reported_) return;
  const std::scoped_lock lock(mutex_);
  snapshot_.state = loop_.telemetry().state();
  snapshot_.cause = loop_.telemetry().cause();
  snapshot_.before_cause.clear();  // among the dropped events may be faults
  append(std::chrono::steady_clock::now(), "state", EventLevel::warning,
         fmt::format("{} events were dropped: the log fell behind; state: {}", dropped - dropped_reported_,
                     wrenchd::name(snapshot_.state)),
         {{"state", wrenchd::name(snapshot_.state)}, {"cause", fault_json(snapshot_.cause)}}, Source::other);
  dropped_reported_ = dropped;
}

FeedSnapshot EventFeed::snapshot() const {
  const std::scoped_lock lock(mutex_);
  return snapshot_;
}

EventFeed::Batch EventFeed::events_since(std::uint64_t next, const std::set<std::string>& names,
                                         std::size_t max_bytes) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t first = snapshot_.sequence + 1 - history_.size();
  Batch batch;
  if (next < first) batch.lost = first - next;
  batch.next = next + batch.lost;
  for (std::size_t bytes = 0; batch.next <= snapshot_.sequence; ++batch.next) {
    const FeedEvent& event = history_[batch.next - first];
    if (!names.empty() && !names.contains(event.name)) continue;
    if (bytes > 0 && bytes + event.line.size() > max_bytes) break;
    bytes += event.line.size();
    batch.lines.push_back(event.line);
  }
  batch.more = batch.next <= snapshot_.sequence;
  return batch;
}

EventFeed::Stored EventFeed::stored_since(std::uint64_t next) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t first = snapshot_.sequence + 1 - history_.size();
  Stored stored;
  if (next < first) stored.lost = first - next;
  for (std::uint64_t at = next + stored.lost; at <= snapshot_.sequence; ++at)
    stored.events.push_back(history_[at - first]);
  return stored;
}

void EventFeed::set_wake_fd(int eventfd) {
  const std::scoped_lock lock(mutex_);
  wake_fd_ = eventfd;
}

}  // namespace wrenchd
