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
  return trigger == Trigger::hard_fault || trigger == Trigger::failed || trigger == Trigger::stop ||
         trigger == Trigger::device_gone;
}

EventLevel level_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::fault:
      return is_grave(static_cast<Fault>(event.detail)) ? EventLevel::error : EventLevel::warning;
    case Event::Kind::state:
    case Event::Kind::placing:
    case Event::Kind::placed:
    case Event::Kind::released:
    case Event::Kind::changing:
    case Event::Kind::changed:
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
    case Fault::loop_stopped:
    case Fault::answer_late:
      return fmt::format(" ({:.1f} ms)", 1e3 * value);
    case Fault::test_rate:
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
std::string name_of(Event::Kind kind) {
  switch (kind) {
    case Event::Kind::state:
      return "state";
    case Event::Kind::fault:
      return "fault";
    case Event::Kind::stiffness:
    case Event::Kind::unbounded:
      return "stiffness";
    case Event::Kind::refused:
      return "refused";
    case Event::Kind::no_admissible_pose:
    case Event::Kind::placing:
    case Event::Kind::placed:
    case Event::Kind::nowhere:
      return "placing";
    case Event::Kind::released:
      return "released";
    case Event::Kind::changing:
    case Event::Kind::changed:
      return "scene";
  }
  return "log";
}

Json fields_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::state:
      return {{"state", name(static_cast<State>(event.detail))}, {"cause", fault_json(cause_of(event))}};
    case Event::Kind::fault:
      return {{"fault", fault_json(static_cast<Fault>(event.detail))}, {"value", event.value}};
    case Event::Kind::stiffness:
      return {{"share", event.value}};
    case Event::Kind::unbounded:
      return {{"share", nullptr}};
    case Event::Kind::refused:
      return {{"state", name(static_cast<State>(event.detail))}};
    case Event::Kind::no_admissible_pose:
      return {{"outcome", "no_admissible_pose"}};
    case Event::Kind::placing:
      return {{"outcome", "seeking"}};
    case Event::Kind::placed:
      return {{"outcome", "placed"}, {"distance_m", event.value}};
    case Event::Kind::nowhere:
      return {{"outcome", "nowhere"}};
    case Event::Kind::changing:
    case Event::Kind::changed:
      return {{"rendering", event.detail}, {"felt", event.kind == Event::Kind::changed}};
    case Event::Kind::released:
      break;
  }
  return Json::object();
}

/// What the event changes in what is known.
void apply(FeedSnapshot& now, const Event& event) {
  if (event.kind == Event::Kind::state) {
    now.state = static_cast<State>(event.detail);
    now.cause = cause_of(event);
    if (now.state == State::self_test) now.stiffness_share = 1.0;  // it is measured anew
  }
  if (event.kind == Event::Kind::stiffness) now.stiffness_share = event.value;
  if (name_of(event.kind) == "placing" && event.kind != Event::Kind::no_admissible_pose)
    now.placing = fields_of(event)["outcome"].get<std::string>();
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
  return {{"name", row.name}, {"sentence", row.sentence}, {"cure", row.cure}};
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
    case Event::Kind::state:
      return fmt::format("state: {}", name(static_cast<State>(event.detail)));
    case Event::Kind::fault: {
      const auto fault = static_cast<Fault>(event.detail);
      const FaultRow& row = fault_row(fault);
      return fmt::format("{}: {}{}; {}", row.name, row.sentence, measured(fault, event.value), row.cure);
    }
    case Event::Kind::stiffness:
      return fmt::format(
          "the device bears {:.0f} % of the stiffness that is asked for, at the rate and delay measured: it "
          "is "
          "scaled; lower it in [wrench], or state more damping in the profile if it has more",
          100.0 * event.value);
    case Event::Kind::unbounded:
      return "the profile states no damping: nobody knows how stiff a wall the device bears; measure it, and "
             "state "
             "damping_N_s_per_m and damping_Nm_s_per_rad";
    case Event::Kind::refused:
      return fmt::format("not armed: {}", transition(Trigger::arm, static_cast<State>(event.detail)).why);
    case Event::Kind::no_admissible_pose:
      return "no admissible pose near the hand: the obstacles leave no room; the proxy stays where it was";
    case Event::Kind::placing:
      return "placing: the admissible pose nearest to the hand is looked for; zero wrench until it is found";
    case Event::Kind::placed:
      return fmt::format("placed {:.1f} mm from the hand", 1e3 * event.value);
    case Event::Kind::nowhere:
      return "no admissible pose was found: the tool does not fit in where the hand is; zero wrench, and it "
             "is looked for again";
    case Event::Kind::released:
      return "the hand is released: zero wrench, motors off";
    case Event::Kind::changing:
      return fmt::format("rendering {} begins to take the place of the one before", event.detail);
    case Event::Kind::changed:
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

void EventFeed::tell(const std::string& name, EventLevel level, const std::string& text, const Json& fields) {
  const std::scoped_lock lock(mutex_);
  keep(std::chrono::steady_clock::now(), name, level, text, fields);
}

/// With the mutex held, so that what an event changes is known with its number and not before.
void EventFeed::keep(TimePoint at, const std::string& name, EventLevel level, const std::string& text,
                     const Json& fields) {
  Json params = {{"sequence", ++now_.sequence},
                 {"time_ns", at.time_since_epoch().count()},
                 {"name", name},
                 {"level", wrenchd::name(level)},
                 {"text", text}};
  for (const auto& [key, value] : fields.items()) params[key] = value;
  kept_.push_back({name, notification_line("event", params)});
  if (kept_.size() > kKept) kept_.pop_front();
  spdlog::log(log_level(level), "{}", text);
  if (wake_ < 0) return;
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_, &one, sizeof one);  // full is awake
}

void EventFeed::keep_faults_by(KeptIn kept_in) {
  const std::scoped_lock draining(draining_);
  kept_in_ = std::move(kept_in);
}

void EventFeed::take(const Event& event) {
  const auto fault = static_cast<Fault>(event.detail);
  std::string kept_in;
  if (event.kind == Event::Kind::fault && is_grave(fault) && kept_in_) kept_in = kept_in_(fault, event.at);
  const std::scoped_lock lock(mutex_);
  const JournalFields fields(journal_fields(event));
  const State from = now_.state;
  apply(now_, event);
  Json fields_told = fields_of(event);
  std::string text = to_text(event);
  if (!kept_in.empty()) {
    fields_told["recording"] = kept_in;
    text += "; what led to it: " + kept_in;
  }
  keep(event.at, name_of(event.kind), level_of(event), text, fields_told);
  if (event.kind == Event::Kind::state) keep_device(event, from);
}

/// That a device came or went is told by the states it leads to, whatever link it is on.
void EventFeed::keep_device(const Event& event, State from) {
  const auto to = static_cast<State>(event.detail);
  if (from == State::disconnected && to != State::shutdown) {
    keep(event.at, "device", EventLevel::info,
         device_was_there_ ? "the device is back" : "the device is there",
         {{"present", true}, {"again", device_was_there_}});
    device_was_there_ = true;
  } else if (to == State::disconnected) {
    keep(event.at, "device", EventLevel::warning, "the device is gone",
         {{"present", false}, {"again", device_was_there_}});
  }
}

void EventFeed::drain() {
  const std::scoped_lock draining(draining_);
  Event event;
  while (loop_.events().pop(event)) take(event);
  const std::uint64_t dropped = loop_.dropped_events();
  if (dropped == dropped_said_) return;
  const std::scoped_lock lock(mutex_);
  now_.state = loop_.state();
  now_.cause = loop_.cause();
  keep(std::chrono::steady_clock::now(), "state", EventLevel::warning,
       fmt::format("{} events were dropped: the log fell behind; state: {}", dropped - dropped_said_,
                   wrenchd::name(now_.state)),
       {{"state", wrenchd::name(now_.state)}, {"cause", fault_json(now_.cause)}});
  dropped_said_ = dropped;
}

FeedSnapshot EventFeed::snapshot() const {
  const std::scoped_lock lock(mutex_);
  return now_;
}

EventFeed::Batch EventFeed::since(std::uint64_t next, const std::set<std::string>& names,
                                  std::size_t max_bytes) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t first = now_.sequence + 1 - kept_.size();
  Batch batch;
  if (next < first) batch.lost = first - next;
  batch.next = next + batch.lost;
  for (std::size_t bytes = 0; batch.next <= now_.sequence; ++batch.next) {
    const Kept& event = kept_[batch.next - first];
    if (!names.empty() && !names.contains(event.name)) continue;
    if (bytes > 0 && bytes + event.line.size() > max_bytes) break;
    bytes += event.line.size();
    batch.lines.push_back(event.line);
  }
  batch.more = batch.next <= now_.sequence;
  return batch;
}

void EventFeed::wake(int eventfd) {
  const std::scoped_lock lock(mutex_);
  wake_ = eventfd;
}

}  // namespace wrenchd
