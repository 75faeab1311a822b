// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/event_log.hpp"

#include <chrono>

#include <spdlog/spdlog.h>

#include "core/fault.hpp"

namespace wrenchd {
namespace {

constexpr auto kPause = std::chrono::milliseconds(20);

spdlog::level::level_enum level_of(const Event& event) {
  switch (event.kind) {
    case Event::Kind::fault: {
      const Trigger trigger = fault_row(static_cast<Fault>(event.detail)).trigger;
      const bool latches = trigger == Trigger::hard_fault || trigger == Trigger::failed ||
                           trigger == Trigger::stop || trigger == Trigger::device_gone;
      return latches ? spdlog::level::err : spdlog::level::warn;
    }
    case Event::Kind::state:
    case Event::Kind::placing:
    case Event::Kind::placed:
    case Event::Kind::released:
    case Event::Kind::changing:
    case Event::Kind::changed:
      return spdlog::level::info;
    default:
      return spdlog::level::warn;
  }
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

}  // namespace

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

EventLog::EventLog(ServoLoop& loop)
    : loop_(loop), thread_([this](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          drain();
          std::this_thread::sleep_for(kPause);
        }
        drain();
      }) {}

EventLog::~EventLog() {
  thread_.request_stop();
  thread_.join();
}

void EventLog::drain() {
  Event event;
  while (loop_.events().pop(event)) spdlog::log(level_of(event), "{}", to_text(event));
  const std::uint64_t dropped = loop_.dropped_events();
  if (dropped > dropped_said_)
    spdlog::warn("{} events were dropped: the log fell behind", dropped - dropped_said_);
  dropped_said_ = dropped;
}

}  // namespace wrenchd
