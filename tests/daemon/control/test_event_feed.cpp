// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/event_feed.hpp"
#include "tests/support/control_rig.hpp"

namespace wrenchd::test_event_feed {

namespace {

using namespace test;
using namespace std::chrono_literals;

std::vector<Json> events_of(const EventFeed& feed, std::uint64_t next,
                            const std::set<std::string>& names = {}) {
  std::vector<Json> events;
  for (const std::string& line : feed.events_since(next, names, 1 << 20).lines)
    events.push_back(Json::parse(line)["params"]);
  return events;
}

TEST_CASE("events of the loop have consecutive numbers, names, levels, times and fields", "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  s.run(0.05);
  s.runtime.loop().requests().arm();
  s.run(1.0);
  REQUIRE(s.state() == State::active);
  s.runtime.loop().requests().stop();
  s.tick();
  feed.drain();
  const auto events = events_of(feed, 1);
  REQUIRE(events.size() > 5);
  for (std::size_t i = 0; i < events.size(); ++i) {
    CHECK(events[i]["sequence"] == i + 1);
    CHECK(events[i]["text"].get<std::string>() != "");
    CHECK(events[i]["time_ns"].is_number_integer());
  }
  std::vector<std::string> states;
  for (const Json& event : events_of(feed, 1, {"state"})) states.push_back(event["state"]);
  CHECK(states == std::vector<std::string>{"disarmed", "waiting", "ramping", "active", "stopped"});
  const auto faults = events_of(feed, 1, {"fault"});
  REQUIRE(faults.size() == 1);
  CHECK(faults[0]["fault"]["name"] == "stop_requested");
  CHECK(faults[0]["fault"]["cure"].get<std::string>() != "");
  CHECK(faults[0]["level"] == "error");
  CHECK(events_of(feed, 1, {"state"}).back()["cause"]["name"] == "stop_requested");
  CHECK(events_of(feed, 1, {"device"})[0]["present"] == true);
  const FeedSnapshot now = feed.snapshot();
  CHECK(now.sequence == events.size());
  CHECK(now.state == State::stopped);
  CHECK(now.cause == Fault::stop_requested);
  CHECK(now.proxy_initialization == "found");
}

TEST_CASE("a snapshot and the events after it give every state of a running loop", "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  std::atomic<bool> stop{false};
  // One thread changes the state of the loop, one drains the events, and this one takes snapshots.
  std::thread life([&] {
    while (!stop) {
      s.runtime.loop().requests().arm();
      s.run(0.6);
      s.runtime.loop().requests().stop();
      s.tick();
      s.runtime.loop().requests().acknowledge();
      s.tick();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  int compared = 0;
  std::map<std::uint64_t, FeedSnapshot> seen;
  for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(1);
       std::chrono::steady_clock::now() < end;) {
    const FeedSnapshot now = feed.snapshot();
    seen.emplace(now.sequence, now);
  }
  stop = true;
  life.join();
  feed.drain();
  std::string state = "disconnected";
  const auto batch = feed.events_since(1, {}, 1 << 24);
  REQUIRE(seen.size() > 5);
  REQUIRE(batch.lost == 0);
  for (const std::string& line : batch.lines) {
    const Json event = Json::parse(line)["params"];
    if (event["name"] == "state") state = event["state"];
    const auto at = seen.find(event["sequence"].get<std::uint64_t>());
    if (at == seen.end()) continue;
    CHECK(name(at->second.state) == state);
    ++compared;
  }
  CHECK(compared > 5);
}

TEST_CASE("a late reader gets the number of lost events and all events that remain", "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  for (std::size_t i = 0; i < EventFeed::kHistorySize + 100; ++i)
    feed.emit(i % 2 == 0 ? "log" : "lease", EventLevel::info, "number " + std::to_string(i), {{"i", i}});
  const std::uint64_t last = feed.snapshot().sequence;
  const auto all = feed.events_since(1, {}, 1 << 24);
  CHECK(all.lines.size() == EventFeed::kHistorySize);
  CHECK(all.lost == last - EventFeed::kHistorySize);
  CHECK(all.next == last + 1);
  CHECK(feed.events_since(all.next, {}, 1 << 24).lines.empty());

  const auto some = feed.events_since(last - 9, {"lease"}, 1 << 24);
  CHECK(some.lines.size() == 5);
  CHECK(some.next == last + 1);

  // Read in pieces, the events are the same.
  std::vector<std::string> pieces;
  for (std::uint64_t next = last - 99; next <= last;) {
    const auto piece = feed.events_since(next, {}, 1000);
    REQUIRE(!piece.lines.empty());
    std::size_t bytes = 0;
    for (const std::string& line : piece.lines) bytes += line.size();
    CHECK(bytes <= 1000);
    pieces.insert(pieces.end(), piece.lines.begin(), piece.lines.end());
    next = piece.next;
  }
  CHECK(pieces == feed.events_since(last - 99, {}, 1 << 24).lines);
}

TEST_CASE("a fault that changes no state is published once in a minute, with the number of repeats",
          "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  s.run(0.05);
  s.runtime.loop().requests().stop();
  s.tick();
  feed.drain();
  const auto before = feed.snapshot().sequence;
  for (int i = 0; i < 50; ++i) {  // a late tick in each second, while the stop is latched
    s.tick_after(std::chrono::milliseconds(10));
    for (int tick = 0; tick < 5; ++tick) s.tick();
    feed.drain();
  }
  const auto late = events_of(feed, before + 1, {"fault"});
  REQUIRE(late.size() == 1);
  CHECK(late[0]["fault"]["name"] == "tick_late");
  CHECK(late[0]["repeats"] == 0);
  s.runtime.loop().requests().acknowledge();
  s.run(0.1);
  feed.drain();
  const auto after = events_of(feed, before + 1, {"fault"});
  REQUIRE(after.size() == 2);
  CHECK(after[1]["fault"]["name"] == "tick_late");
  CHECK(after[1]["repeats"] == 49);
}

TEST_CASE("the snapshot has the newest fault that changed the state, and its time", "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  s.run(0.05);
  feed.drain();
  CHECK(feed.snapshot().last_fault == Fault::none);
  s.runtime.loop().requests().stop();
  s.tick();
  const TimePoint stopped_at = s.clock.now();
  s.runtime.loop().requests().acknowledge();
  s.run(600.0 / 1000.0);
  feed.drain();
  CHECK(feed.snapshot().state == State::disarmed);
  CHECK(feed.snapshot().last_fault == Fault::stop_requested);
  CHECK(feed.snapshot().last_fault_at == stopped_at);
}

TEST_CASE("the snapshot names the faults of the ten seconds before the cause", "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  s.run(0.05);
  feed.drain();
  const TimePoint now = s.clock.now();
  EventQueue& events = s.runtime.loop().telemetry().events();
  events.emit(now - 11s, Event::FaultRaised{Fault::tick_late, 0.0, false});
  events.emit(now - 2s, Event::FaultRaised{Fault::report_malformed, 0.0, false});
  events.emit(now - 1s, Event::FaultRaised{Fault::watchdog_tripped, 0.0});
  events.emit(now - 1s, Event::FaultRaised{Fault::report_malformed, 0.0, false});
  events.emit(now, Event::FaultRaised{Fault::degraded_too_long, 0.0});
  events.emit(now, Event::StateChanged{State::fault, Fault::degraded_too_long});
  feed.drain();
  CHECK(feed.snapshot().before_cause == std::vector{Fault::report_malformed, Fault::watchdog_tripped});
  for (const auto& [state, cause] :
       {std::pair(State::disarmed, Fault::none), std::pair(State::stopped, Fault::stop_requested)}) {
    events.emit(now, Event::StateChanged{state, cause});
    feed.drain();
    CHECK(feed.snapshot().before_cause.empty());
  }
}

TEST_CASE("an error of the flight recorder does not end the feed, and the fault is published",
          "[event_feed]") {
  VirtualRuntime s{resting_config()};
  EventFeed feed(s.runtime.loop());
  feed.set_fault_recorder(
      [](Fault, TimePoint) -> std::string { throw std::runtime_error("the working directory is gone"); });
  s.run(0.05);
  s.runtime.loop().requests().stop();
  s.tick();
  feed.drain();
  REQUIRE(events_of(feed, 1, {"fault"}).size() == 1);
  CHECK(events_of(feed, 1, {"fault"})[0]["fault"]["name"] == "stop_requested");
}

}  // namespace
}  // namespace wrenchd::test_event_feed
