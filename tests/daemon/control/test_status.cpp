// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/daemon_methods.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_status {

namespace {

using namespace test;

/// A loop in virtual time, and its status.
struct Rig {
  VirtualRuntime s;
  EventFeed feed{s.runtime.loop()};
  Lease lease{s.runtime.loop(), feed};
  StatusSections sections;

  Rig() { s.run(0.05); }
  Json status() { return status_json({s.runtime, feed, lease, sections}); }
  /// Reloads a configuration with this limit.
  void reload_limit(double max_force_N) {
    s.runtime.reconfigurator().reload([&] {
      RunConfig config = s.runtime.config();
      config.settings.limits.max_force_N = max_force_N;
      return config;
    });
    s.run(0.01);
  }
};

TEST_CASE("the status has the limits that the loop holds, also after a reload", "[status]") {
  Rig r;
  const Json before = r.status()["limits"];
  CHECK(before["max_force_N"] == r.s.runtime.config().profile.max_force_N);
  r.reload_limit(0.5);
  CHECK(r.status()["limits"]["max_force_N"] == 0.5);
  r.reload_limit(1.5);
  CHECK(r.status()["limits"]["max_force_N"] == 1.5);
  Json other = r.status()["limits"];
  other["max_force_N"] = before["max_force_N"];
  CHECK(other == before);
}

TEST_CASE("a looser limit that the armed loop ignores is not in the status", "[status]") {
  Rig r;
  r.reload_limit(0.5);
  r.s.runtime.loop().requests().arm();
  for (int i = 0; i < 5000 && r.s.state() != State::active; ++i) r.s.tick();
  REQUIRE(r.s.state() == State::active);
  LimitSettings looser = r.s.runtime.config().settings.limits;
  looser.max_force_N = 3.0;
  r.s.runtime.loop().requests().set_limits(looser);  // the loop was armed after the request was decided
  r.s.tick();
  CHECK(r.status()["limits"]["max_force_N"] == 0.5);
}

TEST_CASE("the status names the present scene", "[status]") {
  const TemporaryDirectory files;
  const auto file =
      files.write("empty.toml", "[tool]\nmesh = \"" + test::source_path("config/meshes/cube.off") +
                                    "\"\nscale = 0.001\nmass = 0.2\n");
  Rig r;
  CHECK(r.status()["scene"]["file"] == r.s.runtime.config().scene.file.string());
  CHECK(r.status()["scene"]["obstacles"] == 1);
  r.s.runtime.reconfigurator().replace_scene(file);
  r.s.run(0.1);
  CHECK(r.status()["scene"]["file"] == file.string());
  CHECK(r.status()["scene"]["obstacles"] == 0);
  CHECK(r.status()["scene"]["rendering_id"] == r.s.last.rendering_id);
}

TEST_CASE("the status names the body that the tool holds", "[status]") {
  Rig r;
  CHECK(r.status()["scene"]["held_body"].is_null());
  r.s.runtime.reconfigurator().replace_scene(test::source_path("config/scenes/push_the_box.toml"));
  r.s.run(0.1);
  const TimePoint now = r.s.clock.now();
  r.s.runtime.loop().telemetry().events().emit(now, Event::Grasped{1});
  CHECK(r.status()["scene"]["held_body"] == "box");
  r.s.runtime.loop().telemetry().events().emit(now, Event::LetGo{1, false});
  CHECK(r.status()["scene"]["held_body"].is_null());
}

TEST_CASE("the status names the faults before the cause", "[status]") {
  Rig r;
  const TimePoint now = r.s.clock.now();
  r.s.runtime.loop().telemetry().events().emit(now, Event::FaultRaised{Fault::watchdog_tripped, 0.0});
  r.s.runtime.loop().telemetry().events().emit(now,
                                               Event::StateChanged{State::fault, Fault::degraded_too_long});
  REQUIRE(r.status()["before_cause"].size() == 1);
  CHECK(r.status()["before_cause"][0]["name"] == "watchdog_tripped");
}

TEST_CASE("the status has the last fault with the time of its tick", "[status]") {
  Rig r;
  CHECK(r.status()["last_fault"].is_null());
  r.s.runtime.loop().requests().stop();
  r.s.tick();
  const auto at = r.s.last.now_ns;
  r.s.run(5.0);
  CHECK(r.status()["last_fault"]["name"] == "stop_requested");
  CHECK(r.status()["last_fault"]["time_ns"] == at);
}

}  // namespace
}  // namespace wrenchd::test_status
