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

/// Returns true if a fault latches or releases the hand.
bool is_severe(Fault fault) {
  const Trigger trigger = fault_row(fault).trigger;
  return trigger == Trigger::hard_fault || trigger == Trigger::self_test_failed || trigger == Trigger::stop ||
         trigger == Trigger::device_disconnected;
}

EventLevel level_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::fault_raised:
      return is_severe(static_cast<Fault>(event.detail)) ? EventLevel::error : EventLevel::warning;
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

/// Returns the measured value of a fault event, as text.
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

/// Returns the cause of a state event.
Fault cause_of(const Event& event) {
  return static_cast<Fault>(static_cast<int>(event.value));
}

/// Returns the name of the event on the wire.
std::string event_name(Event::Kind kind) {
  switch (kind) {
    case Event::Kind::state_changed:
      return "state";
    case Event::Kind::fault_raised:
      return "fault";
    case Event::Kind::stiffness_scaled:
    case Event::Kind::stability_bound_unknown:
      return "stiffness";
    case Event::Kind::arming_refused:
      return "arming_refused";
    case Event::Kind::projection_infeasible:
    case Event::Kind::proxy_search_started:
    case Event::Kind::proxy_found:
    case Event::Kind::proxy_search_failed:
      return "proxy_initialization";
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
      return {{"scale", event.value}};
    case Event::Kind::stability_bound_unknown:
      return {{"scale", nullptr}};
    case Event::Kind::arming_refused:
      return {{"state", name(static_cast<State>(event.detail))}};
    case Event::Kind::projection_infeasible:
      return {{"outcome", "projection_infeasible"}};
    case Event::Kind::proxy_search_started:
      return {{"outcome", "searching"}};
    case Event::Kind::proxy_found:
      return {{"outcome", "found"}, {"distance_m", event.value}};
    case Event::Kind::proxy_search_failed:
      return {{"outcome", "failed"}};
    case Event::Kind::crossfade_started:
    case Event::Kind::rendering_changed:
      return {{"rendering_id", event.detail},
              {"crossfade_complete", event.kind == Event::Kind::rendering_changed}};
    case Event::Kind::released:
      break;
  }
  return Json::object();
}

/// Updates the snapshot with an event.
void apply(FeedSnapshot& now, const Event& event) {
  if (event.kind == Event::Kind::state_changed) {
    now.state = static_cast<State>(event.detail);
    now.cause = cause_of(event);
    if (now.state == State::self_test) now.stiffness_scale = 1.0;  // the self-test measures it again
  }
  if (event.kind == Event::Kind::stiffness_scaled) now.stiffness_scale = event.value;
  if (event_name(event.kind) == "proxy_initialization" && event.kind != Event::Kind::projection_infeasible)
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
  return {{"name", row.name}, {"message", row.message}, {"cure", row.cure}};
}

std::span<const EventRow> feed_events() {
  static const std::array<EventRow, 10> rows = {{
      {"state", "The loop entered another state. state: its name; cause: the fault that led to it, or null."},
      {"fault",
       "The loop detected a fault. fault: name, message, cure; value: measured value, if the fault has one; "
       "recording: file of the flight recorder, if it records this fault."},
      {"device",
       "The device connected or disconnected. present: true if connected; reconnected: true if the "
       "device was connected before."},
      {"stiffness",
       "scale: stable fraction of the configured stiffness at the measured rate and delay; null: the profile "
       "states no damping, so the stability bound is unknown."},
      {"arming_refused", "The loop refused to arm. state: state of the loop."},
      {"proxy_initialization",
       "The search for a feasible pose of the proxy, which follows each arming. outcome: searching, found "
       "(distance_m: distance from the handle pose), failed, projection_infeasible."},
      {"released", "The loop released the hand: zero wrench, motors off."},
      {"scene",
       "The rendering changes. rendering_id: number of the new rendering, as in the tick records; "
       "crossfade_complete: false at the start of the crossfade, true at its end."},
      {"reload",
       "The daemon read the configuration again. applied, not_applied: keys; error: why all changes were "
       "rejected, or null."},
      {"log", "Any other log entry."},
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
          "the stiffness is scaled to {:.0f} %: more is unstable at the measured rate and delay; lower the "
          "stiffness in [wrench], or state more damping in the profile if the device has more",
          100.0 * event.value);
    case Event::Kind::stability_bound_unknown:
      return "the profile states no damping, so the stability bound is unknown; measure the damping, and "
             "state "
             "damping_N_s_per_m and damping_Nm_s_per_rad";
    case Event::Kind::arming_refused:
      return fmt::format("not armed: {}", transition(Trigger::arm, static_cast<State>(event.detail)).reason);
    case Event::Kind::projection_infeasible:
      return "no feasible pose near the handle: the obstacles leave no room; the proxy keeps its pose";
    case Event::Kind::proxy_search_started:
      return "proxy initialization: searching the feasible pose nearest to the handle; zero contact force "
             "until "
             "then";
    case Event::Kind::proxy_found:
      return fmt::format("proxy initialized {:.1f} mm from the handle", 1e3 * event.value);
    case Event::Kind::proxy_search_failed:
      return "proxy initialization failed: there is no feasible pose near the handle; zero contact force, "
             "and "
             "the search starts again";
    case Event::Kind::released:
      return "the hand is released: zero wrench, motors off";
    case Event::Kind::crossfade_started:
      return fmt::format("crossfade to rendering {} begins", event.detail);
    case Event::Kind::rendering_changed:
      return fmt::format("crossfade to rendering {} is complete", event.detail);
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

/// Precondition: mutex_ is locked, so that snapshot and sequence number change together.
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

void EventFeed::set_fault_recorder(RecordFault recorded_in) {
  const std::scoped_lock draining(drain_mutex_);
  record_fault_ = std::move(recorded_in);
}

void EventFeed::publish(const Event& event) {
  const auto fault = static_cast<Fault>(event.detail);
  std::string recorded_in;
  if (event.kind == Event::Kind::fault_raised && is_severe(fault) && record_fault_)
    recorded_in = record_fault_(fault, event.at);
  const std::scoped_lock lock(mutex_);
  const JournalFields fields(journal_fields(event));
  const State from = snapshot_.state;
  apply(snapshot_, event);
  Json all_fields = fields_of(event);
  std::string text = to_text(event);
  if (!recorded_in.empty()) {
    all_fields["recording"] = recorded_in;
    text += "; recorded in " + recorded_in;
  }
  append(event.at, event_name(event.kind), level_of(event), text, all_fields);
  if (event.kind == Event::Kind::state_changed) append_device_event(event, from);
}

/// Derives the device events from the states, which are the same for every link.
void EventFeed::append_device_event(const Event& event, State from) {
  const auto to = static_cast<State>(event.detail);
  if (from == State::disconnected && to != State::shutdown) {
    append(event.at, "device", EventLevel::info,
           device_was_present_ ? "the device is connected again" : "the device is connected",
           {{"present", true}, {"reconnected", device_was_present_}});
    device_was_present_ = true;
  } else if (to == State::disconnected) {
    append(event.at, "device", EventLevel::warning, "the device is disconnected",
           {{"present", false}, {"reconnected", device_was_present_}});
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
