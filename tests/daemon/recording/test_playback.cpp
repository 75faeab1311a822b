// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "config/pose_table.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/run_recorder.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_playback {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

const std::string kHeader = "time_s,px,py,pz,qx,qy,qz,qw\n";

/// Returns a pose table from above the table to 5 mm deep inside it.
std::string pressing() {
  std::string text = kHeader;
  for (int i = 0; i <= 300; ++i) {
    const double t_s = 0.01 * i, s = t_s < 1.0 ? 0.0 : std::min(t_s - 1.0, 1.0);
    text += std::to_string(t_s) + ",0,0," + std::to_string(0.065 - 0.045 * s) + ",0,0,0,1\n";
  }
  return text;
}

/// Returns the shipped configuration with this path and playback mode.
RunConfig plan_of(const std::filesystem::path& file, PlaybackMode mode) {
  RunConfig plan = shipped_config();
  SimulationSettings& simulation = plan.settings.simulation;
  simulation.playback = file;
  simulation.playback_mode = mode;
  simulation.playback_path = read_playback(file);
  return plan;
}

/// Runs 3.5 s, armed after 5 ms. Returns the greatest distance of the handle from the path [m]; pushed_N is
/// the greatest force.
double farthest_m(const RunConfig& plan, double& pushed_N) {
  VirtualRuntime s(plan);
  double farthest = 0.0;
  pushed_N = 0.0;
  for (int i = 0; i < 3500; ++i) {
    if (i == 5) s.runtime.loop().requests().arm();
    REQUIRE(s.tick() == Fault::none);
    pushed_N = std::max(pushed_N, s.force_N());
    const Pose goal = s.simulated.hand_target().X_BG;
    farthest = std::max(farthest, (s.simulated.X_BH().translation_m - goal.translation_m).norm());
  }
  return farthest;
}

}  // namespace

TEST_CASE("open playback holds the handle on the table of poses; closed playback pulls it towards the poses",
          "[playback]") {
  const TemporaryDirectory files;
  const auto file = files.write("pressing.csv", pressing());
  double pushed_N = 0.0;
  CHECK(farthest_m(plan_of(file, PlaybackMode::open), pushed_N) < 1e-12);
  CHECK(pushed_N > 2.0);
  CHECK(farthest_m(plan_of(file, PlaybackMode::closed), pushed_N) > 1e-3);
  CHECK(pushed_N > 0.5);
}

TEST_CASE("in open playback the hand supplies the energy that the motors and friction absorb", "[playback]") {
  const TemporaryDirectory files;
  VirtualRuntime s(plan_of(files.write("pressing.csv", pressing()), PlaybackMode::open));
  const SimulatedEnergy& energy = s.simulated.handle().energy();
  double most_kinetic_J = 0.0;
  for (int i = 0; i < 2500; ++i) {
    if (i == 5) s.runtime.loop().requests().arm();
    s.tick();
    const double kinetic_J = s.simulated.handle().kinetic_energy_J();
    most_kinetic_J = std::max(most_kinetic_J, kinetic_J);
    REQUIRE(energy.motors_J + energy.hand_J - energy.friction_J == Approx(kinetic_J).margin(1e-12));
  }
  CHECK(most_kinetic_J > 1e-6);
  CHECK(energy.motors_J < -1e-3);  // pushed in against them
  CHECK(energy.hand_J > 1e-3);
}

TEST_CASE("a played-back recording repeats the motion of the hand", "[playback]") {
  const TemporaryDirectory files;
  const auto file = files.path() / "run.h5";
  {
    VirtualRuntime s(shipped_config());
    RunRecorder recorder(s.runtime, file);
    for (int i = 0; i < 5000; ++i) {
      if (i == 50) s.runtime.loop().requests().arm();
      s.tick();
      recorder.append_new_ticks();
    }
  }
  const Recording before = read_recording(file);
  VirtualRuntime s(plan_of(file, PlaybackMode::open));
  double farthest_m = 0.0;
  std::size_t compared = 0;
  double start_s = 0.0;
  for (const TickRecord& tick : before.ticks) {
    if (tick.fresh == 0) continue;
    if (compared++ == 0) start_s = tick.device_time_s;
    const Duration since = from_seconds(tick.device_time_s - start_s);
    const Pose X = HandPath(s.runtime.config().settings.simulation).at(since).X_BG;
    farthest_m =
        std::max(farthest_m, (X.translation_m - Vector3d(tick.X_BH[0], tick.X_BH[1], tick.X_BH[2])).norm());
    if (compared > 200) break;
  }
  CHECK(compared > 200);
  CHECK(farthest_m < 1e-8);

  // The contact force is the same within the resolution of the encoders.
  double then_N = 0.0, now_N = 0.0;
  for (const TickRecord& tick : before.ticks) then_N = std::max(then_N, std::abs(tick.F_T[2]));
  for (int i = 0; i < 5000; ++i) {
    if (i == 50) s.runtime.loop().requests().arm();
    s.tick();
    now_N = std::max(now_N, std::abs(s.last.F_T[2]));
  }
  CHECK(then_N > 1.0);
  CHECK(now_N == Approx(then_N).epsilon(0.05));
}

TEST_CASE("a file that cannot be played back is rejected", "[playback]") {
  const TemporaryDirectory files;
  CHECK_THROWS_WITH(read_playback(files.path() / "none.csv"), Contains("cannot be read; name a recording"));
  CHECK_THROWS_WITH(read_playback(files.path()), Contains("cannot be read"));
  CHECK_THROWS_WITH(read_playback(files.write("bad.csv", "garbage")),
                    Contains("bad.csv:1:1: expected the header"));
  CHECK_THROWS_WITH(read_playback(files.write("bad.h5", "\x89HDF\r\n\x1a\n garbage")),
                    Contains("bad.h5: is"));
  std::vector<TickRecord> ticks(10);
  const auto recorded = [&](const char* name) {
    const auto file = files.path() / name;
    RecordingWriter writer(file, {});
    writer.append(ticks);
    return file;
  };
  CHECK_THROWS_WITH(read_playback(recorded("still.h5")), Contains("has no valid sample"));
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    ticks[i].tick = i;
    ticks[i].now_ns = 1;
    ticks[i].fresh = 1;
    ticks[i].device_time_s = 0.001 * static_cast<double>(i) + (i > 5 ? 3.0 : 0.0);
    ticks[i].X_BH[6] = 1.0;
  }
  CHECK_THROWS_WITH(read_playback(recorded("gap.h5")), Contains("before tick 6 there is a gap of 3.00"));
}

TEST_CASE("wrenchd plays back the file of its command line", "[playback][program]") {
  const TemporaryDirectory files;
  const auto csv = files.write("pressing.csv", pressing());
  const std::vector<std::string> run = {
      "--config", test::source_path("config/wrenchd.toml"), "--virtual-time", "--seconds", "3.5", "--arm",
      "--live"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), run.begin(), run.end());
    return run_program("wrenchd", more);
  };
  const ProgramResult open = with({"--playback", csv.string(), "--playback-mode", "open"});
  INFO(open.err);
  CHECK(open.exit_code == 0);
  CHECK(open.out.find("tool   +0.0   +0.0  +20.0 mm") != std::string::npos);
  const ProgramResult closed = with({"--playback", csv.string()});
  CHECK(closed.exit_code == 0);
  CHECK(closed.out.find("+20.0 mm") == std::string::npos);
  const ProgramResult bad = with({"--playback", files.write("bad.csv", kHeader + "0,0,0\n").string()});
  CHECK(bad.exit_code == 1);
  CHECK(bad.err.find("bad.csv:2:1: expected 8 numbers") != std::string::npos);
  const ProgramResult alone = with({"--playback-mode", "open"});
  CHECK(alone.exit_code == 1);
  CHECK(alone.err.find("there is no playback file; name one with --playback") != std::string::npos);
  const ProgramResult real = run_program("wrenchd", {"--profile", "polhem", "--playback", csv.string()});
  CHECK(real.exit_code == 1);
  CHECK(real.err.find("--playback: a person moves a real device") != std::string::npos);
}

}  // namespace wrenchd::test_playback
