// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/mount.h>

#include "daemon/realtime.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/wall_clock.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

using namespace wrenchd;
using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Matchers::Contains;

namespace {

RunConfig plan_with(const std::filesystem::path& directory) {
  RunConfig plan = shipped_config();
  plan.settings.servo.realtime = Realtime::best_effort;
  plan.settings.recording.directory = directory;
  plan.settings.recording.keep_free_MB = 0.0;
  return plan;
}

/// Events `recording` so far.
std::vector<Json> told(EventFeed& feed, const std::string& name = "recording") {
  std::vector<Json> events;
  feed.drain();
  for (const std::string& line : feed.events_since(1, {name}, 1 << 20).lines)
    events.push_back(Json::parse(line)["params"]);
  return events;
}

/// A loop in wall time, with its recordings.
struct LiveRun {
  SimulatedRuntime<WallClock> s;
  EventFeed feed;
  Recordings recordings;
  std::atomic<bool> stop{false};
  std::thread servo;

  explicit LiveRun(const RunConfig& plan)
      : s(plan), feed(s.runtime.loop()), recordings(s.runtime, feed, s.clock), servo([this] {
          prepare_servo_thread(s.runtime.config().settings.servo);
          s.runtime.loop().run(s.clock, stop);
        }) {}
  ~LiveRun() {
    stop = true;
    if (servo.joinable()) servo.join();
  }

  template <class Condition>
  bool comes_true(const Condition& condition, std::chrono::seconds limit = 20s) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!condition() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(5ms);
    return condition();
  }
};

/// Every tick once, in order.
bool is_gapless(const Recording& recording) {
  for (std::size_t i = 1; i < recording.ticks.size(); ++i)
    if (recording.ticks[i].tick != recording.ticks[i - 1].tick + 1 && recording.ticks[i].released == 0)
      return false;
  return true;
}

}  // namespace

TEST_CASE("a recording begins and ends in mid-run, with every tick in between", "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(plan_with(files.path()));
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  const auto run = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      s.tick();
      if (i % 100 == 0) recordings.pump();
    }
  };
  run(700);
  CHECK_FALSE(recordings.status().running);
  CHECK_FALSE(recordings.stop());
  const auto file = recordings.start("mine", false);
  CHECK(file == files.path() / "mine.h5");
  CHECK_THROWS_WITH(recordings.start("other", false), Contains("mine.h5: a recording runs already"));
  run(5000);
  CHECK(recordings.status().running->ticks > 3000);
  const auto written = recordings.stop();
  REQUIRE(written);
  CHECK(written->ticks == 5000);
  CHECK(written->lost == 0);
  run(100);
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 5000);
  CHECK(recording.ticks.front().tick == 700);
  CHECK(is_gapless(recording));
  CHECK(recording.header.virtual_time);
  // The same moment by two clocks.
  CHECK(recording.header.started_ns == recording.ticks.front().now_ns - 1'000'000);
  CHECK_THROWS_WITH(recordings.start("mine", false), Contains("never overwrites"));
  CHECK(recordings.start("", false).filename().string().starts_with("run-20"));
  CHECK(recordings.stop()->ticks == 0);
  const auto events = told(feed);
  REQUIRE(events.size() == 4);
  CHECK(events[0]["phase"] == "started");
  CHECK(events[1]["phase"] == "ended");
  CHECK(events[1]["ticks"] == 5000);
}

TEST_CASE("ticks that nobody took in time are counted, and the recording goes on", "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(plan_with(files.path()));
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  const auto file = recordings.start("mine", false);
  for (int i = 0; i < 5000; ++i) s.tick();  // the shared memory holds some two thousand
  const auto written = recordings.stop();
  REQUIRE(written);
  CHECK(written->lost > 2000);
  CHECK(written->ticks + written->lost == 5000);
  CHECK(told(feed).back()["lost"] == written->lost);
  CHECK(read_recording(file).ticks.back().tick == 4999);
}

TEST_CASE("a directory that cannot be written to, and a disk without room, are refused", "[recording]") {
  const TemporaryDirectory files;
  RunConfig plan = plan_with(files.write("file", "") / "below");
  {
    VirtualRuntime s(plan);
    EventFeed feed(s.runtime.loop());
    Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
    CHECK_THROWS_WITH(recordings.start("mine", false), Contains("cannot be created"));
    CHECK_THROWS_WITH(recordings.start("/nowhere/x.h5", true), Contains("cannot be created"));
    CHECK_FALSE(recordings.status().running);
  }
  plan.settings.recording.directory = files.path();
  plan.settings.recording.keep_free_MB = 1e7;
  VirtualRuntime s(plan);
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  CHECK_THROWS_WITH(recordings.start("mine", false), Contains("MB are free"));
  CHECK_FALSE(std::filesystem::exists(files.path() / "mine.h5"));
}

TEST_CASE("a recording on a disk that fills up ends with an event, and what is in it can be read",
          "[recording][root]") {
  const TemporaryDirectory files;
  const auto disk = files.path() / "disk";
  std::filesystem::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=3m") != 0) {
    WARN("no small disk could be made (this takes root): not tried");
    return;
  }
  const double keep_free_MB = GENERATE(0.0, 1.0);  // the disk itself says no; we stop before it does
  INFO("keep_free_MB " << keep_free_MB);
  std::string failed;
  {
    RunConfig plan = plan_with(disk);
    plan.settings.recording.keep_free_MB = keep_free_MB;
    VirtualRuntime s(plan);
    EventFeed feed(s.runtime.loop());
    Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
    recordings.start("mine", false);
    for (int i = 0; i < 40000 && recordings.status().running; ++i) {
      if (i == 50) s.runtime.loop().requests().arm();
      s.tick();
      if (i % 500 == 0) recordings.pump();
    }
    failed = recordings.status().failed;
    CHECK_FALSE(recordings.status().running);
    CHECK(told(feed).back()["phase"] == "failed");
    CHECK_FALSE(recordings.stop());
  }
  INFO(failed);
  if (keep_free_MB > 0.0) {
    CHECK(failed.find("MB are free") != std::string::npos);
    CHECK(read_recording(disk / "mine.h5").ticks.size() > 500);
  } else {
    CHECK(failed.find("is the disk full, ") != std::string::npos);
  }
  umount(disk.c_str());
}

TEST_CASE("the flight recorder writes what led to a fault, and the second after", "[recording][flight]") {
  const TemporaryDirectory files;
  RunConfig plan = plan_with(files.path());
  plan.settings.recording.flight_s = 1.5;
  plan.settings.recording.flights_kept = 2;
  LiveRun run(plan);
  std::string last;
  for (std::uint64_t flight = 1; flight <= 3; ++flight) {
    REQUIRE(run.comes_true([&] {
      if (run.s.runtime.loop().telemetry().state() == State::fault)
        run.s.runtime.loop().requests().acknowledge();
      return run.s.runtime.loop().telemetry().state() == State::disarmed;
    }));
    std::this_thread::sleep_for(1s);
    const TimePoint at = run.s.clock.now();
    run.s.runtime.loop().requests().stop();
    const auto flights = run.recordings.status().flights;
    REQUIRE(run.comes_true([&] { return run.recordings.status().flights > flights; }));
    last = run.recordings.status().last_flight.string();
    const Recording recording = read_recording(last);
    CHECK(is_gapless(recording));
    const double before_s =
        1e-9 * static_cast<double>(at.time_since_epoch().count() - recording.ticks.front().now_ns);
    const double after_s =
        1e-9 * static_cast<double>(recording.ticks.back().now_ns - at.time_since_epoch().count());
    CHECK(before_s > 0.9);
    CHECK(before_s < 1.6);
    CHECK(after_s > 0.9);
    CHECK(after_s < 1.2);
    bool stopped = false;
    for (const TickRecord& tick : recording.ticks)
      stopped = stopped || (tick.faults & bit(Fault::stop_requested)) != 0;
    CHECK(stopped);
    run.s.runtime.loop().requests().acknowledge();
    std::this_thread::sleep_for(1100ms);  // a name of another second
  }
  const auto faults = told(run.feed, "fault");
  bool named = false;
  for (const Json& fault : faults)
    named = named || (fault.contains("recording") && fault["recording"] == last);
  CHECK(named);
  std::size_t kept = 0;
  for (const auto& entry : std::filesystem::directory_iterator(files.path())) {
    (void)entry;
    ++kept;
  }
  CHECK(kept == 2);
}

TEST_CASE("a flight that cannot be written is told, and the loop goes on", "[recording][flight]") {
  const TemporaryDirectory files;
  RunConfig plan = plan_with(files.write("file", "") / "below");
  LiveRun run(plan);
  REQUIRE(run.comes_true([&] { return run.s.runtime.loop().telemetry().state() == State::disarmed; }));
  run.s.runtime.loop().requests().stop();
  REQUIRE(run.comes_true([&] {
    const auto events = told(run.feed);
    return !events.empty() && events.back()["phase"] == "failed";
  }));
  CHECK(told(run.feed).back()["reason"].get<std::string>().find("cannot be created") != std::string::npos);
  CHECK(run.recordings.status().flights == 0);
  CHECK(run.s.runtime.loop().telemetry().state() == State::stopped);
}

TEST_CASE("what was going on when the loop ended is in the file", "[recording][flight]") {
  const TemporaryDirectory files;
  {
    LiveRun run(plan_with(files.path()));
    REQUIRE(run.comes_true([&] { return run.s.runtime.loop().telemetry().state() == State::disarmed; }));
    run.recordings.start("mine", false);
    std::this_thread::sleep_for(300ms);
    run.s.runtime.loop().requests().stop();
    REQUIRE(run.comes_true([&] { return !told(run.feed, "fault").empty(); }));
    run.stop = true;
    run.servo.join();
  }
  const Recording mine = read_recording(files.path() / "mine.h5");
  CHECK(mine.ticks.size() > 250);
  CHECK(static_cast<State>(mine.ticks.back().state) == State::shutdown);
  bool flight = false;
  for (const auto& entry : std::filesystem::directory_iterator(files.path()))
    if (entry.path().filename().string().starts_with("flight-"))
      flight = static_cast<State>(read_recording(entry.path()).ticks.back().state) == State::shutdown;
  CHECK(flight);
}
