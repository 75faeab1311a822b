// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "daemon/recording/recordings.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_event_log {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

RunConfig config_with(const std::filesystem::path& directory) {
  RunConfig config = shipped_config();
  config.settings.recording.directory = directory;
  config.settings.recording.keep_free_MB = 0.0;
  return config;
}

}  // namespace

TEST_CASE("a recording has the events since its start, each with the tick in which it happened",
          "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(config_with(files.path()));
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  const auto run = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      s.tick();
      if (i % 100 == 0) recordings.pump();
    }
  };
  run(1000);
  feed.drain();
  const std::uint64_t before = feed.snapshot().sequence;
  CHECK(before > 0);
  CHECK_FALSE(recordings.mark("too early", Json::object()));
  const auto file = recordings.start("mine", false);
  run(100);
  s.runtime.loop().requests().request(kArm);
  run(2000);
  const auto marked = recordings.mark("trial 3", {{"stiffness", 2000}, {"surface", "rubber"}});
  REQUIRE(marked);
  CHECK(marked->file == file);
  run(50);
  CHECK_THROWS_WITH(recordings.mark("", Json::object()), Contains("label"));
  recordings.stop();

  const Recording recording = read_recording(file);
  REQUIRE(recording.events.size() >= 3);
  const auto named = [&](const std::string& name, const std::string& text) {
    const auto found = std::find_if(recording.events.begin(), recording.events.end(), [&](const auto& e) {
      return e.name == name && e.text.starts_with(text);
    });
    REQUIRE(found != recording.events.end());
    return *found;
  };
  for (const RecordedEvent& one : recording.events) CHECK(one.time_ns >= recording.header.started_ns);
  const RecordedEvent active = named("state", "state: active");
  const auto tick = std::find_if(recording.ticks.begin(), recording.ticks.end(), [&](const auto& t) {
    return static_cast<std::int64_t>(t.tick) == active.tick;
  });
  REQUIRE(tick != recording.ticks.end());
  CHECK(tick->now_ns == active.time_ns);
  CHECK(tick->state == static_cast<std::uint8_t>(State::active));
  CHECK((tick - 1)->state != static_cast<std::uint8_t>(State::active));
  const RecordedEvent marker = named("marker", "trial 3");
  CHECK(Json::parse(marker.conditions) == Json{{"stiffness", 2000}, {"surface", "rubber"}});
  CHECK(marker.tick > active.tick);
  CHECK(marker.tick <= static_cast<std::int64_t>(recording.ticks.back().tick));
}

TEST_CASE("events that left the history of the feed are counted in the recording", "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(config_with(files.path()));
  EventFeed feed(s.runtime.loop());
  EventLog log(feed, feed.snapshot().sequence + 1, 0, EventLog::EmittedTime::as_stated);
  for (std::size_t i = 0; i < EventFeed::kHistorySize + 6; ++i)
    feed.emit("log", EventLevel::info, std::to_string(i));
  const auto events = log.take_all(0);
  REQUIRE(events.size() == EventFeed::kHistorySize + 1);
  CHECK(events[0].name == "events_lost");
  CHECK(events[0].value == 6.0);
  CHECK(events[1].text == "6");
  CHECK(log.take_all(0).empty());
  feed.emit("log", EventLevel::info, "later");
  CHECK(log.take(0).empty());  // its time is after the newest tick
  CHECK(log.take_all(0).size() == 1);
}

}  // namespace wrenchd::test_event_log
