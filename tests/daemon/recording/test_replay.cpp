// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>

#include "daemon/recording/recorded_inputs.hpp"
#include "daemon/recording/replay.hpp"
#include "tests/support/buried_tool.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_recorder.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_replay {

using namespace wrenchd::test;

namespace {

/// Records a run of this configuration with faults, disarming and arming, and at its end an unplugging.
void record_run(const RunConfig& plan, const std::filesystem::path& file, double duration_s) {
  VirtualRuntime s(plan);
  s.inject(SimulatedFault::Kind::corrupt, 3.0, 0.003);
  s.inject(SimulatedFault::Kind::silence, 3.5, 0.006);
  s.inject(SimulatedFault::Kind::unplug, duration_s - 0.01, 1.0);
  RunRecorder recorder(s.runtime, file);
  for (int i = 0; i < static_cast<int>(1000 * duration_s); ++i) {
    if (i == 50 || i == 4500) s.runtime.loop().requests().arm();
    if (i == 4200) s.runtime.loop().requests().disarm();
    const bool lost = s.tick() == Fault::device_lost;
    recorder.append_new_ticks();
    if (lost) break;
  }
  REQUIRE(recorder.is_complete());
}

RunConfig recording_plan(Method method) {
  RunConfig plan = shipped_config();
  plan.settings.rendering.method = method;
  plan.settings.wrench.gains.integral = WrenchGains::blockwise(100.0, 0.3);
  plan.settings.limits.max_force_N = 1.2;
  return plan;
}

}  // namespace

TEST_CASE("a replayed recording gives the same bits", "[replay]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const RunConfig plan = recording_plan(method);
  record_run(plan, file, 6.0);
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() > 5900);
  CHECK(recording.ticks.back().faults == bit(Fault::device_lost));
  const auto difference = replay(recording, plan);
  if (difference) INFO("tick " << difference->tick << ' ' << difference->field);
  CHECK_FALSE(difference.has_value());
}

TEST_CASE("a replay applies external wrenches as the loop did", "[replay][external_wrench]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const RunConfig plan = shipped_config();
  {
    VirtualRuntime s(plan);
    RunRecorder recorder(s.runtime, file);
    s.runtime.loop().requests().arm();
    for (int i = 0; i < 3000; ++i) {
      const double expires_s = i < 2000 ? 0.05 : 0.005;
      if (i % 7 == 0)
        s.runtime.loop().requests().set_external_wrench(
            {{{0.0, 0.5, 2.0 * std::sin(0.02 * i)}, {0.0, 0.01, 0.0}},
             1e-3,
             s.clock.now() + from_seconds(expires_s)});
      s.tick();
      recorder.append_new_ticks();
    }
    REQUIRE(recorder.is_complete());
  }
  Recording recording = read_recording(file);
  const auto acted = std::count_if(recording.ticks.begin(), recording.ticks.end(),
                                   [](const TickRecord& tick) { return tick.F_external[1] != 0.0; });
  REQUIRE(acted > 500);
  CHECK_FALSE(replay(recording, plan).has_value());
  const auto later = std::find_if(recording.ticks.begin() + 1500, recording.ticks.end(),
                                  [](const TickRecord& tick) { return tick.external_expires_ns != 0; });
  later->external_energy_J *= 2.0;
  const auto difference = replay(recording, plan);
  REQUIRE(difference.has_value());
  CHECK(difference->tick == later->tick);
  CHECK(difference->field == "external_balance_J");
}

TEST_CASE("a replay applies friction as the loop did", "[replay][friction]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RunConfig plan = recording_plan(Method::exact);
  plan.settings.rendering.friction = {0.6, 0.4};
  record_run(plan, file, 6.0);
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() > 5900);
  int stuck = 0;
  for (std::size_t i = 1; i < recording.ticks.size(); ++i) {
    const TickRecord& tick = recording.ticks[i];
    stuck += tick.contacts > 0 && tick.X_WQ == recording.ticks[i - 1].X_WQ ? 1 : 0;
  }
  CHECK(stuck > 100);
  CHECK_FALSE(replay(recording, plan).has_value());
  // The friction of the replay is that of its configuration.
  plan.settings.rendering.friction = {0.5, 0.4};
  CHECK(replay(recording, plan).has_value());
}

TEST_CASE("a replay initializes the proxy at the recorded ticks and poses",
          "[replay][proxy_initialization]") {
  // Inside the boulder, out of it, and back against it, with two reinitializations of the proxy.
  BuriedTool buried({{0.0, {0, 0, 0.03}}, {0.4, {0, 0, 0.03}}, {1.2, {0, 0, 0.12}}, {1.8, {0, 0, 0.078}}});
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  int searching = 0;
  int found = 0;
  {
    VirtualRuntime s(buried.config,
                     ProxySearchMode::background);  // a thread's results arrive at arbitrary ticks
    RunRecorder recorder(s.runtime, file);
    for (int i = 0; i < 4000; ++i) {
      if (i == 5) s.runtime.loop().requests().arm();
      if (i == 20 || i == 3500) s.runtime.loop().requests().reinitialize_proxy();
      wait_for_proxy_search(s);
      REQUIRE(s.tick() == Fault::none);
      recorder.append_new_ticks();
      searching += proxy_initialization(s) == ProxyInitialization::searching ? 1 : 0;
      found += proxy_initialization(s) == ProxyInitialization::found ? 1 : 0;
    }
    s.runtime.loop().release(s.clock.now());
  }
  CHECK(searching > 2);
  CHECK(found >= 2);
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 4001);
  auto difference = replay(recording, buried.config);
  if (difference) INFO("tick " << difference->tick << ' ' << difference->field);
  CHECK_FALSE(difference.has_value());

  // Another initial pose changes all following ticks.
  Recording changed = recording;
  for (TickRecord& tick : changed.ticks)
    if (static_cast<ProxyInitialization>(tick.proxy_initialization) == ProxyInitialization::found)
      tick.X_WQ[0] += 1e-4;
  difference = replay(changed, buried.config);
  REQUIRE(difference.has_value());
  CHECK(difference->field.rfind("X_WQ[", 0) == 0);
}

TEST_CASE("a replay has moving obstacles at their recorded poses", "[replay][moving]") {
  BuriedTool buried({{0.0, {0, 0, 0.03}}, {0.4, {0, 0, 0.03}}, {1.2, {0, 0, 0.12}}, {1.8, {0, 0, 0.078}}});
  buried.config.scene.meshes[0].motion = {{0.0, 0.0, 0.01}, {0.0, 0.3, 0.0}, 0.7};
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  {
    VirtualRuntime s(buried.config, ProxySearchMode::background);
    s.clock.sleep_until(TimePoint{from_seconds(77777.7)});  // the loop's own time begins later
    RunRecorder recorder(s.runtime, file);
    for (int i = 0; i < 3000; ++i) {
      if (i == 5) s.runtime.loop().requests().arm();
      if (i == 2500) s.runtime.loop().requests().reinitialize_proxy();
      wait_for_proxy_search(s);
      REQUIRE(s.tick() == Fault::none);
      recorder.append_new_ticks();
    }
  }
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 3000);
  const auto difference = replay(recording, buried.config);
  if (difference) INFO("tick " << difference->tick << ' ' << difference->field);
  CHECK_FALSE(difference.has_value());
}

TEST_CASE("a recording without its beginning is rejected", "[replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const RunConfig plan = recording_plan(Method::exact);
  record_run(plan, file, 0.5);
  Recording recording = read_recording(file);
  recording.ticks.erase(recording.ticks.begin(), recording.ticks.begin() + 100);
  std::string why;
  try {
    replay(recording, plan);
  } catch (const RecordingError& error) {
    why = error.what();
  }
  CHECK(why.find("begins at tick 100") != std::string::npos);
  CHECK(why.find("wrenchd --record") != std::string::npos);
  recording.ticks.clear();
  CHECK_FALSE(replay(recording, plan).has_value());
}

TEST_CASE("a search without a feasible pose fails in the replay as well", "[replay][proxy_initialization]") {
  RunConfig plan = recording_plan(Method::exact);
  plan.scene.half_spaces = closed_box(0.02);
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  record_run(plan, file, 4.0);
  CHECK_FALSE(replay(read_recording(file), plan).has_value());
}

TEST_CASE("a replay names the first tick and field that differ", "[replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RunConfig plan = recording_plan(Method::exact);
  plan.settings.wrench.law = SpringLaw::pid;
  record_run(plan, file, 3.0);
  Recording recording = read_recording(file);
  recording.ticks[2500].F_out[2] = std::nextafter(recording.ticks[2500].F_out[2], 1.0);
  auto difference = replay(recording, plan);
  REQUIRE(difference.has_value());
  CHECK(difference->tick == 2500);
  CHECK(difference->field == "F_out[2]");

  recording = read_recording(file);
  plan.settings.wrench.gains.stiffness *= 1.0000001;
  difference = replay(recording, plan);
  REQUIRE(difference.has_value());
  CHECK(difference->field.rfind("F_T[", 0) == 0);
}

TEST_CASE("a replay stops at a change by a client that the recording does not contain, and reports it",
          "[replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const RunConfig plan = recording_plan(Method::exact);
  {
    VirtualRuntime s(plan);
    RunRecorder recorder(s.runtime, file);
    for (int i = 0; i < 3000; ++i) {
      if (i == 50) s.runtime.loop().requests().arm();
      if (i == 2000)
        s.runtime.reconfigurator().set_rendering(read_toml_text("[wrench]\nlaw = \"energy\"", "here"),
                                                 "here");
      REQUIRE(s.tick() == Fault::none);
      recorder.append_new_ticks();
    }
  }
  Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 3000);
  CHECK_THROWS_WITH(replay(recording, plan),
                    Catch::Contains("at tick 2000 a client changed the scene, the workspace or a limit"));
  recording.ticks.resize(2000);
  CHECK_FALSE(replay(recording, plan).has_value());
}

TEST_CASE("a replay stops at missing ticks, and reports them", "[replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const RunConfig plan = recording_plan(Method::exact);
  record_run(plan, file, 1.0);
  Recording recording = read_recording(file);
  recording.ticks.erase(recording.ticks.begin() + 500, recording.ticks.begin() + 510);
  CHECK_THROWS_WITH(replay(recording, plan), Catch::Contains("ticks 500 to 509 are missing"));
  recording.ticks.resize(500);
  CHECK_FALSE(replay(recording, plan).has_value());
}

TEST_CASE("a replay needs no file but the recording", "[replay]") {
  // The run uses copies of all files, which the test deletes before the replay. The scene has a mesh
  // obstacle, and the profile inherits from another.
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const std::filesystem::path there = test::source_path("config");
  const auto copies = directory.path() / "copies";
  std::filesystem::create_directories(copies);
  for (const char* name : {"meshes", "scenes", "hands", "profiles"})
    std::filesystem::copy(there / name, copies / name, std::filesystem::copy_options::recursive);
  directory.write("copies/profiles/heir.toml", "inherits = \"loopback\"\nname = \"heir\"\n");
  directory.write("copies/mine.toml",
                  "scene = \"scenes/cube_over_plunger.toml\"\n[device]\nprofile = \"heir\"\n"
                  "[servo]\nself_test_s = 0\n[wrench]\nlaw = \"pid\"\n");
  {
    const RunConfig plan = load_run_config({copies / "mine.toml", {}, {}, false}, SearchPath({copies}));
    record_run(plan, file, 4.0);
  }
  std::filesystem::remove_all(copies);
  const Recording recording = read_recording(file);
  const RunConfig plan = unpack_run_config(recording.header, directory.path() / "unpacked");
  CHECK(plan.profile.name == "heir");
  CHECK(plan.settings.wrench.law == SpringLaw::pid);
  CHECK(plan.scene.meshes.size() == 1);
  int touching = 0;
  for (std::size_t i = 0; i < recording.ticks.size(); ++i)
    touching += recording.contacts_of(i).empty() ? 0 : 1;
  CHECK(touching > 500);
  CHECK_FALSE(replay(recording, plan).has_value());

  RecordingHeader lacking = recording.header;
  std::erase_if(lacking.files, [](const RecordedFile& f) { return f.role == "tool"; });
  CHECK_THROWS_WITH(unpack_run_config(lacking, directory.path() / "lacking"),
                    Catch::Contains("does not contain the mesh 'tool'") && Catch::Contains("--scene"));
  RecordingHeader outside = recording.header;
  for (RecordedFile& f : outside.files)
    if (f.role == "tool") f.embedded = false;
  CHECK_THROWS_WITH(unpack_run_config(outside, directory.path() / "outside"),
                    Catch::Contains("cannot be read any more") && Catch::Contains("SHA-256"));
}

}  // namespace wrenchd::test_replay
