// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/event_feed.hpp"

#include <array>
#include <chrono>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/event_journal.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

constexpr auto kPause = std::chrono::milliseconds(10);

/// Whether a fault latches, or lets go of the hand.
bool is_grave(Fault fault) {
  const Trigger trigger = fault_row(fault).trigger;
  return trigger == Trigger::hard_fault || trigger == Trigger::self_test_failed || trigger == Trigger::stop ||
         trigger == Trigger::device_disconnected;
}

EventLevel level_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::fault_raised:
      return is_grave(static_cast<Fault>(event.detail)) ? EventLevel::error : EventLevel::warning;
    case Event::Kind::state_changed:
    case Event::Kind::proxy_search_started:
    case Event::Kind::proxy_found:
    case Event::Kind::released:
    case Event::Kind::crossfade_started:
    case Event::Kind::rendering_changed:
      return EventLevel::info;
    default:
      return EventLevel::warning;
  }
}

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

/// What the value of a fault's event says.
std::string measured(Fault fault, double value) {
  switch (fault) {
    case Fault::tick_late:
    case Fault::loop_stalled:
    case Fault::wrench_late:
      return fmt::format(" ({:.1f} ms)", 1e3 * value);
    case Fault::self_test_rate:
      return fmt::format(" ({:.0f} a second)", value);
    default:
      return {};
  }
}

/// The cause that came with a state.
Fault cause_of(const Event& event) {
  return static_cast<Fault>(static_cast<int>(event.value));
}

/// The name that programs know it by.
std::string generated_mesh_name(Event::Kind kind) {
  switch (kind) {
    case Event::Kind::state_changed:
      return "state";
    case Event::Kind::fault_raised:
      return "fault";
    case Event::Kind::stiffness_scaled:
    case Event::Kind::stability_bound_unknown:
      return "stiffness";
    case Event::Kind::arming_refused:
      return "refused";
    case Event::Kind::projection_infeasible:
    case Event::Kind::proxy_search_started:
    case Event::Kind::proxy_found:
    case Event::Kind::proxy_search_failed:
      return "placing";
    case Event::Kind::released:
      return "released";
    case Event::Kind::crossfade_started:
    case Event::Kind::rendering_changed:
      return "scene";
  }
  return "log";
}

Json fields_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::state_changed:
      return {{"state", name(static_cast<State>(event.detail))}, {"cause", fault_json(cause_of(event))}};
    case Event::Kind::fault_raised:
      return {{"fault", fault_json(static_cast<Fault>(event.detail))}, {"value", event.value}};
    case Event::Kind::stiffness_scaled:
      return {{"share", event.value}};
    case Event::Kind::stability_bound_unknown:
      return {{"share", nullptr}};
    case Event::Kind::arming_refused:
      return {{"state", name(static_cast<State>(event.detail))}};
    case Event::Kind::projection_infeasible:
      return {{"outcome", "no_admissible_pose"}};
    case Event::Kind::proxy_search_started:
      return {{"outcome", "seeking"}};
    case Event::Kind::proxy_found:
      return {{"outcome", "placed"}, {"distance_m", event.value}};
    case Event::Kind::proxy_search_failed:
      return {{"outcome", "nowhere"}};
    case Event::Kind::crossfade_started:
    case Event::Kind::rendering_changed:
      return {{"rendering", event.detail}, {"felt", event.kind == Event::Kind::rendering_changed}};
    case Event::Kind::released:
      break;
  }
  return Json::object();
}

/// What the event changes in what is known.
void apply(FeedSnapshot& now, const Event& event) {
  if (event.kind == Event::Kind::state_changed) {
    now.state = static_cast<State>(event.detail);
    now.cause = cause_of(event);
    if (now.state == State::self_test) now.stiffness_scale = 1.0;  // it is measured anew
  }
  if (event.kind == Event::Kind::stiffness_scaled) now.stiffness_scale = event.value;
  if (generated_mesh_name(event.kind) == "placing" && event.kind != Event::Kind::projection_infeasible)
    now.proxy_initialization = fields_of(event)["outcome"].get<std::string>();
}

}  // namespace

const char* name(EventLevel level) noexcept {
  switch (level) {
    case EventLevel::info:
      return "info";
    case EventLevel::warning:
      return "warning";
    case EventLevel::error:
      return "error";
  }
  return "unknown";
}

Json fault_json(Fault fault) {
  if (fault == Fault::none) return nullptr;
  const FaultRow& row = fault_row(fault);
  return {{"name", row.name}, {"sentence", row.message}, {"cure", row.cure}};
}

std::span<const EventRow> feed_events() {
  static const std::array<EventRow, 10> rows = {{
      {"state", "The loop came to another state. state: its name; cause: the fault that led to it, or null."},
      {"fault",
       "Something is wrong. fault: name, sentence, cure; value: how much of it, where that says "
       "something; recording: the file of the flight recorder, where one is kept of it."},
      {"device", "present: whether there is a device now; again: it has been there before."},
      {"stiffness",
       "share: of the stiffness asked for that the device bears, at the rate and delay "
       "measured; null: its profile states no damping, so nobody knows."},
      {"refused", "It was asked to arm, and was not. state: in which it was."},
      {"placing",
       "outcome: seeking, placed (distance_m: how far from the hand), nowhere, "
       "no_admissible_pose. Where the tool stands is looked for after each arming."},
      {"released", "The hand was released: zero wrench, motors off."},
      {"scene",
       "What is rendered changes. rendering: the number of the new one, as in the record of a tick; felt: "
       "false where it begins to take the place of the one before, true where it has."},
      {"reload", "The configuration was read again. applied, not_applied: keys; refused: why, or null."},
      {"log", "What else the log has."},
  }};
  return rows;
}

std::string to_text(const Event& event) {
  switch (event.kind) {
    case Event::Kind::state_changed:
      return fmt::format("state: {}", name(static_cast<State>(event.detail)));
    case Event::Kind::fault_raised: {
      const auto fault = static_cast<Fault>(event.detail);
      const FaultRow& row = fault_row(fault);
      return fmt::format("{}: {}{}; {}", row.name, row.message, measured(fault, event.value), row.cure);
    }
    case Event::Kind::stiffness_scaled:
      return fmt::format(
          "the device bears {:.0f} % of the stiffness that is asked for, at the rate and delay measured: it "
          "is "
          "scaled; lower it in [wrench], or state more damping in the profile if it has more",
          100.0 * event.value);
    case Event::Kind::stability_bound_unknown:
      return "the profile states no damping: nobody knows how stiff a wall the device bears; measure it, and "
             "state "
             "damping_N_s_per_m and damping_Nm_s_per_rad";
    case Event::Kind::arming_refused:
      return fmt::format("not armed: {}", transition(Trigger::arm, static_cast<State>(event.detail)).reason);
    case Event::Kind::projection_infeasible:
      return "no admissible pose near the hand: the obstacles leave no room; the proxy stays where it was";
    case Event::Kind::proxy_search_started:
      return "placing: the admissible pose nearest to the hand is looked for; zero wrench until it is found";
    case Event::Kind::proxy_found:
      return fmt::format("placed {:.1f} mm from the hand", 1e3 * event.value);
    case Event::Kind::proxy_search_failed:
      return "no admissible pose was found: the tool does not fit in where the hand is; zero wrench, and it "
             "is looked for again";
    case Event::Kind::released:
      return "the hand is released: zero wrench, motors off";
    case Event::Kind::crossfade_started:
      return fmt::format("rendering {} begins to take the place of the one before", event.detail);
    case Event::Kind::rendering_changed:
      return fmt::format("rendering {} is felt from now on", event.detail);
  }
  return "unknown event";
}

EventFeed::EventFeed(ServoLoop& loop)
    : loop_(loop), thread_([this](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          drain();
          std::this_thread::sleep_for(kPause);
        }
        drain();
      }) {}

EventFeed::~EventFeed() {
  thread_.request_stop();
  thread_.join();
}

void EventFeed::emit(const std::string& name, EventLevel level, const std::string& text, const Json& fields) {
  const std::scoped_lock lock(mutex_);
  append(std::chrono::steady_clock::now(), name, level, text, fields);
}

/// With the mutex held, so that what an event changes is known with its number and not before.
void EventFeed::append(TimePoint at, const std::string& name, EventLevel level, const std::string& text,
                       const Json& fields) {
  Json params = {{"sequence", ++snapshot_.sequence},
                 {"time_ns", at.time_since_epoch().count()},
                 {"name", name},
                 {"level", wrenchd::name(level)},
                 {"text", text}};
  for (const auto& [key, value] : fields.items()) params[key] = value;
  history_.push_back({name, notification_line("event", params)});
  if (history_.size() > kHistorySize) history_.pop_front();
  spdlog::log(log_level(level), "{}", text);
  if (wake_fd_ < 0) return;
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_fd_, &one, sizeof one);  // full is awake
}

void EventFeed::set_fault_recorder(RecordFault kept_in) {
  const std::scoped_lock draining(drain_mutex_);
  record_fault_ = std::move(kept_in);
}

void EventFeed::publish(const Event& event) {
  const auto fault = static_cast<Fault>(event.detail);
  std::string kept_in;
  if (event.kind == Event::Kind::fault_raised && is_grave(fault) && record_fault_)
    kept_in = record_fault_(fault, event.at);
  const std::scoped_lock lock(mutex_);
  const JournalFields fields(journal_fields(event));
  const State from = snapshot_.state;
  apply(snapshot_, event);
  Json fields_told = fields_of(event);
  std::string text = to_text(event);
  if (!kept_in.empty()) {
    fields_told["recording"] = kept_in;
    text += "; what led to it: " + kept_in;
  }
  append(event.at, generated_mesh_name(event.kind), level_of(event), text, fields_told);
  if (event.kind == Event::Kind::state_changed) append_device_event(event, from);
}

/// That a device came or went is told by the states it leads to, whatever link it is on.
void EventFeed::append_device_event(const Event& event, State from) {
  const auto to = static_cast<State>(event.detail);
  if (from == State::disconnected && to != State::shutdown) {
    append(event.at, "device", EventLevel::info,
           device_was_present_ ? "the device is back" : "the device is there",
           {{"present", true}, {"again", device_was_present_}});
    device_was_present_ = true;
  } else if (to == State::disconnected) {
    append(event.at, "device", EventLevel::warning, "the device is gone",
           {{"present", false}, {"again", device_was_present_}});
  }
}

void EventFeed::drain() {
  const std::scoped_lock draining(drain_mutex_);
  Event event;
  while (loop_.events().pop(event)) publish(event);
  const std::uint64_t dropped = loop_.dropped_events();
  if (dropped == dropped_reported_) return;
  const std::scoped_lock lock(mutex_);
  snapshot_.state = loop_.state();
  snapshot_.cause = loop_.cause();
  append(std::chrono::steady_clock::now(), "state", EventLevel::warning,
         fmt::format("{} events were dropped: the log fell behind; state: {}", dropped - dropped_reported_,
                     wrenchd::name(snapshot_.state)),
         {{"state", wrenchd::name(snapshot_.state)}, {"cause", fault_json(snapshot_.cause)}});
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
    const StoredEvent& event = history_[batch.next - first];
    if (!names.empty() && !names.contains(event.name)) continue;
    if (bytes > 0 && bytes + event.line.size() > max_bytes) break;
    bytes += event.line.size();
    batch.lines.push_back(event.line);
  }
  batch.more = batch.next <= snapshot_.sequence;
  return batch;
}

void EventFeed::set_wake_fd(int eventfd) {
  const std::scoped_lock lock(mutex_);
  wake_fd_ = eventfd;
}

}  // namespace wrenchd
