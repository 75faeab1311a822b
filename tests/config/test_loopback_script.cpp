// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_loopback_script.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_loopback_script {

namespace {

namespace fs = std::filesystem;
using namespace test;

/// Runs wrenchd with a script in virtual time.
ProgramResult run_script(const TemporaryDirectory& dir, const std::string& script,
                         const std::string& seconds = "4", std::vector<std::string> more = {}) {
  const fs::path file = dir.write("script.toml", script);
  std::vector<std::string> arguments = {"--virtual-time", "--seconds",         seconds,
                                        "--arm",          "--loopback-script", file.string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program("wrenchd", arguments);
}

bool says(const ProgramResult& result, const std::string& text) {
  return result.err.find(text) != std::string::npos;
}

int count(const ProgramResult& result, const std::string& text) {
  int found = 0;
  for (std::size_t at = result.err.find(text); at != std::string::npos; at = result.err.find(text, at + 1))
    ++found;
  return found;
}

TEST_CASE("all commands of a script are read, sorted by time", "[loopback_script]") {
  const TemporaryDirectory dir;
  const LoopbackScript script = load_loopback_script(dir.write("s.toml", R"(
[[fault]]
at_s = 1.5
for_s = 0.01
kind = "silence"
[[fault]]
at_s = 2
for_s = 0.5
kind = "delay_reports"
value = 0.008
[[command]]
at_s = 3.0
command = "stop"
[[command]]
at_s = 0.5
command = "arm"
)"));
  REQUIRE(script.faults.size() == 2);
  CHECK(script.faults[0].kind == SimulatedFault::Kind::silence);
  CHECK(script.faults[0].start == std::chrono::milliseconds(1500));
  CHECK(script.faults[0].duration == std::chrono::milliseconds(10));
  CHECK(script.faults[0].value == 0.0);
  CHECK(script.faults[1].value == 0.008);
  REQUIRE(script.commands.size() == 2);
  CHECK(script.commands[0].commands == kArm);
  CHECK(script.commands[1].at == std::chrono::seconds(3));
}

TEST_CASE("an invalid script is rejected with location and remedy", "[loopback_script]") {
  const TemporaryDirectory dir;
  const auto rejection = [&](const std::string& text) -> std::string {
    try {
      load_loopback_script(dir.write("s.toml", text));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "nothing";
  };
  using Catch::Matchers::Contains;
  CHECK_THAT(rejection("[[fault]]\nat_s = 1\nfor_s = 1\nkind = \"silense\"\n"),
             Contains("4:8") && Contains("silence"));
  CHECK_THAT(rejection("[[fault]]\nat_s = -1\nfor_s = 1\nkind = \"silence\"\n"), Contains("2:8"));
  CHECK_THAT(rejection("[[fault]]\nat_s = 1\nkind = \"silence\"\n"), Contains("fault[0].for_s"));
  CHECK_THAT(rejection("[[fault]]\nat_s = 1\nfor_s = 1\nkind = \"silence\"\nvalue = 3\n"),
             Contains("5:9") && Contains("leave it out"));
  CHECK_THAT(rejection("[[command]]\nat_s = 1\ncommand = \"jump\"\n"),
             Contains("3:11") && Contains("disarm"));
  CHECK_THAT(rejection("[[fualt]]\nat_s = 1\n"), Contains("fualt") && Contains("fault"));
  CHECK_THAT(rejection("fault = 3\n"), Contains("[[fault]]"));
}

TEST_CASE("a short silence degrades the loop, which recovers; the exit code is 0", "[loopback_script]") {
  const TemporaryDirectory dir;
  const auto result = run_script(dir, "[[fault]]\nat_s = 3.0\nfor_s = 0.01\nkind = \"silence\"\n");
  INFO(result.err);
  CHECK(result.exit_code == 0);
  CHECK(says(result, "sample_late: the newest pose is a few milliseconds old"));
  CHECK(says(result, "state: degraded"));
  const auto degraded = result.err.find("state: degraded");
  CHECK(result.err.find("state: active", degraded) != std::string::npos);
}

TEST_CASE("a latched fault stays until its acknowledgement and sets the exit code", "[loopback_script]") {
  const TemporaryDirectory dir;
  const std::string fault = "[[fault]]\nat_s = 2.0\nfor_s = 0.1\nkind = \"drift\"\n";
  const auto left = run_script(dir, fault);
  INFO(left.err);
  CHECK(left.exit_code == 3);
  CHECK(says(left, "overspeed: the handle moved faster"));
  CHECK(says(left, "state: fault"));
  const auto seen = run_script(dir, fault + "[[command]]\nat_s = 3.0\ncommand = \"acknowledge\"\n");
  CHECK(seen.exit_code == 0);
  const auto latched = seen.err.find("state: fault");
  const auto tested = seen.err.find("state: self-test", latched);
  CHECK(tested != std::string::npos);
  CHECK(seen.err.find("state: disarmed", tested) != std::string::npos);
  CHECK(seen.err.find("state: waiting", tested) ==
        std::string::npos);  // it does not arm again without a request
}

TEST_CASE("a stop, a stall and a client without heartbeats each have their exit code", "[loopback_script]") {
  const TemporaryDirectory dir;
  CHECK(says(run_script(dir, "[[command]]\nat_s = 2.5\ncommand = \"stop\"\n"), "state: stopped"));
  const auto stalled = run_script(dir, "[[fault]]\nat_s = 2.5\nfor_s = 0.009\nkind = \"stall\"\n");
  INFO(stalled.err);
  CHECK(says(stalled, "state: degraded"));
  CHECK(stalled.exit_code == 0);
  const auto sleepy = run_script(dir, "[[fault]]\nat_s = 0\nfor_s = 9\nkind = \"disable_watchdog\"\n");
  CHECK(sleepy.exit_code == 3);
  CHECK(says(sleepy, "self_test_watchdog: the device's watchdog did not trip"));
  CHECK_FALSE(says(sleepy, "state: waiting"));
  const fs::path file = dir.write("lease.toml", "[[command]]\nat_s = 1.0\ncommand = \"arm_with_lease\"\n");
  const auto alone =
      run_program("wrenchd", {"--virtual-time", "--seconds", "4", "--loopback-script", file.string()});
  CHECK(says(alone, "heartbeat_missing: the client that armed has never sent a heartbeat"));
  CHECK(alone.exit_code == 0);
}

constexpr const char* kUnplugged = R"(
[[fault]]
at_s = 2.0
for_s = 0.2
kind = "unplug"

[[command]]
at_s = 3.5
command = "arm"
)";

TEST_CASE("an unplugged simulated device comes back disarmed", "[loopback_script]") {
  const TemporaryDirectory dir;
  for (const char* profile : {"loopback", "polhem"}) {
    const auto run = run_script(dir, kUnplugged, "5", {"--simulate", profile});
    INFO(profile << "\n" << run.err);
    CHECK(run.exit_code == 0);
    CHECK(says(run, "device_lost"));
    CHECK(says(run, "the device is connected again, and is disarmed"));
    // Armed by --arm, tested again after the reconnection, then armed by the script only.
    for (const char* state : {"state: self-test", "state: disarmed", "state: waiting"}) {
      INFO(state);
      CHECK(count(run, state) == 2);
    }
  }
}

TEST_CASE("a run ends while its simulated device is unplugged", "[loopback_script]") {
  const TemporaryDirectory dir;
  const auto run = run_script(dir, "[[fault]]\nat_s = 2.0\nfor_s = 60.0\nkind = \"unplug\"\n", "4");
  INFO(run.err);
  CHECK(run.exit_code == 0);
  CHECK(says(run, "device_lost"));
  CHECK_FALSE(says(run, "connected again"));
}

TEST_CASE("an unplugged simulated device comes back disarmed in wall time", "[loopback_script][wall_time]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("script.toml", kUnplugged);
  const auto run = run_program("wrenchd", {"--realtime", "off", "--control", "none", "--seconds", "4",
                                           "--loopback-script", file.string()});
  INFO(run.err);
  CHECK(run.exit_code == 0);
  CHECK(says(run, "the device is connected again, and is disarmed"));
}

TEST_CASE("a script requires a simulated device that supports its faults", "[loopback_script]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("s.toml", "[[fault]]\nat_s = 1\nfor_s = 1\nkind = \"drift\"\n");
  const auto real =
      run_program("wrenchd", {"--profile", "reference_full_speed", "--loopback-script", file.string()});
  CHECK(real.exit_code == 1);
  CHECK(says(real, "a real device cannot run a script; simulate a device"));
  const auto arm = run_program("wrenchd", {"--simulate", "polhem", "--virtual-time", "--seconds", "1",
                                           "--loopback-script", file.string()});
  CHECK(arm.exit_code == 1);
  CHECK(says(arm, "s.toml: an emulated arm does not support this fault; the loopback device does"));
}

}  // namespace
}  // namespace wrenchd::test_loopback_script
