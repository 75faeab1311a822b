// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <future>
#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/mount.h>

#include "daemon/realtime.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/wall_clock.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_recordings {

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

/// Returns all events of this name so far.
std::vector<Json> events_named(EventFeed& feed, const std::string& name = "recording") {
  std::vector<Json> events;
  feed.drain();
  for (const std::string& line : feed.events_since(1, {name}, 1 << 20).lines)
    events.push_back(Json::parse(line)["params"]);
  return events;
}

/// A loop in wall time with its recordings.
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

/// Returns true if the recording has every tick once, in order.
bool is_gapless(const Recording& recording) {
  for (std::size_t i = 1; i < recording.ticks.size(); ++i)
    if (recording.ticks[i].tick != recording.ticks[i - 1].tick + 1 && recording.ticks[i].released == 0)
      return false;
  return true;
}

}  // namespace

TEST_CASE("a recording starts and stops during a run, and has every tick between", "[recording]") {
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
  CHECK_THROWS_WITH(recordings.start("other", false),
                    Contains("mine.h5: a recording is already running; stop it first"));
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
  const auto events = events_named(feed);
  REQUIRE(events.size() == 4);
  CHECK(events[0]["phase"] == "started");
  CHECK(events[1]["phase"] == "ended");
  CHECK(events[1]["ticks"] == 5000);
}

TEST_CASE("ticks that the recorder did not read in time are counted, and the recording continues",
          "[recording]") {
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
  CHECK(events_named(feed).back()["lost"] == written->lost);
  CHECK(read_recording(file).ticks.back().tick == 4999);
}

TEST_CASE("a directory that is not writable, and a disk without space, are rejected", "[recording]") {
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

TEST_CASE("a recording on a full disk ends with an event, and its ticks can be read", "[recording][root]") {
  const TemporaryDirectory files;
  const auto disk = files.path() / "disk";
  std::filesystem::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=3m") != 0) {
    WARN("the test could not mount a small disk, which requires root; it did not run");
    return;
  }
  const double keep_free_MB =
      GENERATE(0.0, 1.0);  // 0: the disk rejects the write; 1: wrenchd stops before the disk is full
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
    CHECK(events_named(feed).back()["phase"] == "failed");
    CHECK_FALSE(recordings.stop());
  }
  INFO(failed);
  if (keep_free_MB > 0.0) {
    CHECK(failed.find("MB are free") != std::string::npos);
    CHECK(read_recording(disk / "mine.h5").ticks.size() > 500);
  } else {
    CHECK(failed.find("check that the disk is connected and not full") != std::string::npos);
  }
  umount(disk.c_str());
}

TEST_CASE("the flight recorder writes the ticks before a fault, and the second after it",
          "[recording][flight]") {
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
    std::this_thread::sleep_for(1100ms);  // the next flight gets another second in its name
  }
  const auto faults = events_named(run.feed, "fault");
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

TEST_CASE("a flight recording that cannot be written is reported, and the loop continues",
          "[recording][flight]") {
  const TemporaryDirectory files;
  RunConfig plan = plan_with(files.write("file", "") / "below");
  LiveRun run(plan);
  REQUIRE(run.comes_true([&] { return run.s.runtime.loop().telemetry().state() == State::disarmed; }));
  run.s.runtime.loop().requests().stop();
  REQUIRE(run.comes_true([&] {
    const auto events = events_named(run.feed);
    return !events.empty() && events.back()["phase"] == "failed";
  }));
  CHECK(events_named(run.feed).back()["reason"].get<std::string>().find("cannot be created") !=
        std::string::npos);
  CHECK(run.recordings.status().flights == 0);
  CHECK(run.s.runtime.loop().telemetry().state() == State::stopped);
}

// The thread of the feed collects events every few milliseconds. The recordings close before it has the
// fault.
TEST_CASE("a fault in the last tick gets its flight when the recordings close", "[recording][flight]") {
  for (int round = 0; round < 5; ++round) {
    const TemporaryDirectory files;
    VirtualRuntime s(plan_with(files.path()));
    EventFeed feed(s.runtime.loop());
    {
      const Recordings recordings(s.runtime, feed, s.clock);
      for (int i = 0; i < 700; ++i) s.tick();
      s.runtime.loop().requests().stop();
      s.tick();
    }
    CHECK(std::distance(std::filesystem::directory_iterator(files.path()), {}) == 1);
  }
}

TEST_CASE("recordings contain the ticks up to the end of the loop", "[recording][flight]") {
  const TemporaryDirectory files;
  {
    LiveRun run(plan_with(files.path()));
    REQUIRE(run.comes_true([&] { return run.s.runtime.loop().telemetry().state() == State::disarmed; }));
    run.recordings.start("mine", false);
    std::this_thread::sleep_for(300ms);
    run.s.runtime.loop().requests().stop();
    REQUIRE(run.comes_true([&] { return run.s.runtime.loop().telemetry().state() == State::stopped; }));
    run.stop = true;
    run.servo.join();
  }
  const Recording mine = read_recording(files.path() / "mine.h5");
  CHECK(mine.ticks.size() > 250);
  CHECK(static_cast<State>(mine.ticks.back().state) == State::shutdown);
  bool flight = false;
  for (const auto& entry : std::filesystem::directory_iterator(files.path()))
    if (entry.path().filename().string().starts_with("flight-"))
      flight =
          flight || static_cast<State>(read_recording(entry.path()).ticks.back().state) == State::shutdown;
  CHECK(flight);
}

TEST_CASE("a recording that begins after a change of the scene has the text of the present scene",
          "[recording]") {
  const TemporaryDirectory files;
  RunConfig plan = plan_with(files.path());
  VirtualRuntime s(plan);
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  const auto recorded = [&](const char* name) {
    const auto file = recordings.start(name, false);
    s.run(0.01);
    recordings.stop();
    return read_recording(file).header;
  };
  const std::string cube = "mesh = \"" + test::source_path("config/meshes/cube.off") + "\"\nscale = 0.001\n";
  const std::string other = "# another scene\n[tool]\n" + cube +
                            "mass = 0.3\n[[obstacle]]\nname = \"post\"\n" + cube +
                            "position_m = [0.2, 0.0, 0.0]\n";
  const auto file = files.write("other.toml", other);
  CHECK(recorded("at_start").scene_file == plan.scene.file);
  s.runtime.reconfigurator().replace_scene(file);
  const RecordingHeader loaded = recorded("loaded");
  CHECK(loaded.scene == other);
  CHECK(loaded.scene_file == file);
  files.write("other.toml", "# changed afterwards\n");
  CHECK(recorded("edited").scene == other);
  s.run(0.5);
  s.runtime.reconfigurator().remove_obstacle("post");
  const RecordingHeader changed = recorded("changed");
  CHECK_THAT(changed.scene, Contains("The scene as wrenchd renders it") && !Contains("post"));
}

TEST_CASE("a recording contains the mesh that was loaded, whatever its file has become", "[recording]") {
  const TemporaryDirectory files;
  const std::string mesh = [] {
    std::ifstream in(test::source_path("config/meshes/cube.off"), std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(in), {}};
  }();
  const auto file = files.write("tool.off", mesh),
             secret = files.write("secret", "root:$6$sEcReT:1:0:9:7:::\n");
  RunConfig plan = plan_with(files.path());
  plan.scene.tool.mesh = file;
  VirtualRuntime s(plan);
  std::filesystem::remove(file);
  std::filesystem::create_symlink(secret, file);
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  const auto tool = [&](const char* name) {
    const auto recording = recordings.start(name, false);
    s.run(0.01);
    recordings.stop();
    for (const RecordedFile& one : read_recording(recording).header.files)
      if (one.role == "tool") return one.bytes;
    return std::string();
  };
  CHECK(tool("at_start") == mesh);
  // A change of another obstacle reads the file of the tool no more.
  TomlNode block;
  block.value = TomlNode::Table{};
  const auto set = [&block](const char* key, TomlNode::Value value) {
    TomlEntry entry;
    entry.key = key;
    entry.node.value = std::move(value);
    std::get<TomlNode::Table>(block.value).push_back(std::move(entry));
  };
  set("name", std::string("block"));
  set("mesh", test::source_path("config/meshes/cube.off"));
  set("scale", 0.001);
  CHECK(s.runtime.reconfigurator().insert_obstacle(block, "test") == "block");
  CHECK(tool("changed") == mesh);
}

TEST_CASE("a header of a recording does not wait while another scene is being built", "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(plan_with(files.path()));
  std::atomic<bool> built{false};
  std::promise<void> reading, go_on;
  std::thread builder([&] {
    try {
      s.runtime.reconfigurator().reload([&]() -> RunConfig {
        reading.set_value();
        go_on.get_future().wait();
        throw std::invalid_argument("a test needs no configuration");
      });
    } catch (const std::invalid_argument&) {
    }
    built = true;
  });
  reading.get_future().wait();
  CHECK_FALSE(s.runtime.recording_header().scene.empty());
  CHECK_FALSE(built);
  go_on.set_value();
  builder.join();
}

TEST_CASE("a name of the flight recorder is rejected for a recording", "[recording]") {
  const TemporaryDirectory files;
  VirtualRuntime s(plan_with(files.path()));
  EventFeed feed(s.runtime.loop());
  Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
  CHECK_THROWS_WITH(recordings.start("flight-20261122T141501Z-overspeed", false),
                    Contains("has the name of a file of the flight recorder"));
  CHECK_NOTHROW(recordings.start("flight-9", false));
}

TEST_CASE("a recording goes on when the working directory is removed", "[recording]") {
  const TemporaryDirectory files;
  const auto previous = std::filesystem::current_path();
  const auto removed = files.path() / "removed";
  std::filesystem::create_directory(removed);
  {
    VirtualRuntime s(plan_with(files.path() / "recordings"));
    EventFeed feed(s.runtime.loop());
    Recordings recordings(s.runtime, feed, s.clock, Recordings::Pace::manual);
    std::filesystem::current_path(removed);
    recordings.start_file("../mine.h5");
    std::filesystem::remove(removed);
    for (int i = 0; i < 3000; ++i) {
      s.tick();
      if (i % 100 == 0) CHECK_NOTHROW(recordings.pump());
    }
    recordings.close();
    CHECK_THROWS_WITH(recordings.start("late", false), Contains("the daemon ends"));
  }
  std::filesystem::current_path(previous);
  CHECK(read_recording(files.path() / "mine.h5").ticks.size() == 3000);
}

}  // namespace wrenchd::test_recordings
