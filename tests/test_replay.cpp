// SPDX-License-Identifier: GPL-3.0-or-later
#include <fstream>

#include <catch2/catch.hpp>

#include "daemon/recorder.hpp"
#include "daemon/replay.hpp"
#include "tests/support/shipped_plan.hpp"
#include "tests/support/temporary_directory.hpp"

using namespace wrenchd;
using namespace wrenchd::test;

namespace {

/// A run of the shipped station with everything in it that a tick can do, recorded to a file.
void record_run(const Plan& plan, const std::filesystem::path& file, double duration_s) {
  VirtualStation s(plan);
  s.inject(SimulatedFault::Kind::garble, 3.0, 0.003);
  s.inject(SimulatedFault::Kind::silence, 3.5, 0.006);
  s.inject(SimulatedFault::Kind::unplug, duration_s - 0.01, 1.0);
  Recorder recorder(s.station.records(), file, s.station.recording_header());
  for (int i = 0; i < static_cast<int>(1000 * duration_s); ++i) {
    if (i == 50 || i == 4500) s.station.loop().arm();
    if (i == 4200) s.station.loop().disarm();
    if (s.tick() != Fault::none) break;
  }
  REQUIRE(s.station.loop().dropped_records() == 0);
}

Plan recording_plan(Method method) {
  Plan plan = shipped_plan();
  plan.settings.rendering.method = method;
  plan.settings.wrench.gains.integral = WrenchGains::blockwise(100.0, 0.3);
  plan.settings.limits.max_force_N = 1.2;
  plan.settings.recording.file = "set";  // so that the loop records; the test writes the file itself
  return plan;
}

}  // namespace

TEST_CASE("a replayed recording gives the same bits", "[replay]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const Plan plan = recording_plan(method);
  record_run(plan, file, 6.0);
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() > 5900);
  CHECK(recording.ticks.back().fault == static_cast<std::uint8_t>(Fault::device_lost));
  const auto difference = replay(recording, plan);
  if (difference) INFO("tick " << difference->tick << ' ' << difference->field);
  CHECK_FALSE(difference.has_value());
}

TEST_CASE("a replay names the first tick and field that differ", "[replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  Plan plan = recording_plan(Method::exact);
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
