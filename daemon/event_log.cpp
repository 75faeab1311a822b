// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/event_log.hpp"

#include <chrono>

#include <spdlog/spdlog.h>

#include "core/fault.hpp"

namespace wrenchd {
namespace {

constexpr auto kPause = std::chrono::milliseconds(20);

spdlog::level::level_enum level_of(Event::Kind kind) {
  switch (kind) {
    case Event::Kind::fault:
      return spdlog::level::err;
    case Event::Kind::engagement:
    case Event::Kind::placing:
    case Event::Kind::placed:
    case Event::Kind::released:
      return spdlog::level::info;
    default:
      return spdlog::level::warn;
  }
}

}  // namespace

std::string to_text(const Event& event) {
  switch (event.kind) {
    case Event::Kind::engagement:
      return fmt::format("engagement: {}", name(static_cast<Engagement>(event.detail)));
    case Event::Kind::fault: {
      const FaultText fault = text(static_cast<Fault>(event.detail));
      return fmt::format("fault {}: {}; {}", fault.name, fault.sentence, fault.cure);
    }
    case Event::Kind::late_tick:
      return fmt::format("a tick came {:.1f} ms late; the soft start begins anew", 1e3 * event.value);
    case Event::Kind::stale_sample:
      return fmt::format("the newest pose is {:.1f} ms old; zero wrench until a new one comes",
                         1e3 * event.value);
    case Event::Kind::reports_missing:
      return fmt::format("{} reports of the device are missing", event.detail);
    case Event::Kind::reports_rejected:
      return fmt::format("{} reports rejected: garbled, of another length or id, or out of order",
                         event.detail);
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
  while (loop_.events().pop(event)) spdlog::log(level_of(event.kind), "{}", to_text(event));
  const std::uint64_t dropped = loop_.dropped_events();
  if (dropped > dropped_said_)
    spdlog::warn("{} events were dropped: the log fell behind", dropped - dropped_said_);
  dropped_said_ = dropped;
}

}  // namespace wrenchd
