// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <csignal>
#include <cstring>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/control/json_rpc.hpp"
#include "daemon/recording/recorded_run.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/soon.hpp"

namespace wrenchd::test_two_hands {

// wrenchd with two simulated hands.

namespace {

namespace fs = std::filesystem;
using namespace test;
using Catch::Contains;

const std::string kLeft = R"(
[[hand]]
name = "left"
[hand.device]
base_in_world = { position_m = [0.0, 0.15, 0.0] }
[hand.limits]
max_force_N = 2.0
[hand.tool]
mesh = { make = "sphere", triangles = 500 }
mass = 0.2
)";

fs::path write_config(const TemporaryDirectory& dir, const std::string& text = "") {
  return dir.write("wrenchd.toml", text + kLeft);
}

struct VirtualRun {
  ProgramResult result;
  Recording first, left;
};

VirtualRun run_virtual(std::vector<std::string> more = {}, const std::string& config = "") {
  const TemporaryDirectory dir;
  const std::string file = (dir.path() / "run.h5").string();
  more.insert(more.begin(), {"--config", write_config(dir, config).string(), "--virtual-time", "--seconds",
                             "3", "--arm", "--record", file});
  VirtualRun run;
  run.result = run_program("wrenchd", more);
  INFO(run.result.err);
  REQUIRE(fs::exists(file));
  run.first = read_recording(file);
  run.left = read_recording(dir.path() / "run-left.h5");
  return run;
}

/// Compares numbers that may be NaN.
template <class Numbers>
bool same_bits(const Numbers& a, const Numbers& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// Compares all that does not depend on the speed of the machine.
bool same(const Recording& a, const Recording& b) {
  return std::equal(a.ticks.begin(), a.ticks.end(), b.ticks.begin(), b.ticks.end(),
                    [](const TickRecord& x, const TickRecord& y) {
                      return x.tick == y.tick && x.now_ns == y.now_ns && x.state == y.state &&
                             same_bits(x.X_WP, y.X_WP) && same_bits(x.X_WQ, y.X_WQ) &&
                             same_bits(x.F_out, y.F_out);
                    });
}

double largest_force_N(const Recording& recording) {
  double largest = 0.0;
  for (const TickRecord& tick : recording.ticks)
    largest = std::max(largest, Vector3d(tick.F_out[0], tick.F_out[1], tick.F_out[2]).norm());
  return largest;
}

/// Two simulated hands in wall time, and wrenchctl on the socket of each.
struct TwoHandDaemon {
  TemporaryDirectory dir;
  std::string socket = (dir.path() / "control.sock").string();
  std::string socket_of_left = (dir.path() / "control-left.sock").string();
  RunningProgram program;

  TwoHandDaemon()
      : program(
            "wrenchd",
            {"--realtime", "best_effort", "--config",
             write_config(dir, "[servo]\nself_test_s = 0.1\nlate_limit_s = 1.0\n[recording]\ndirectory = '" +
                                   (dir.path() / "rec").string() + "'\n")
                 .string(),
             "--control", socket}) {
    INFO(program.err());
    REQUIRE(program.wait_for_output("control socket: " + socket));
    REQUIRE(program.wait_for_output("left: control socket: " + socket_of_left));
    for (const std::string& one : {socket, socket_of_left})
      REQUIRE(soon([&] { return status(one)["state"] == "disarmed"; }));
  }

  static ProgramResult ctl(std::vector<std::string> words, const std::string& at) {
    words.insert(words.end(), {"--socket", at});
    return run_program("wrenchctl", words);
  }
  static Json status(const std::string& at) {
    const ProgramResult result = ctl({"status", "--json"}, at);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return Json::parse(result.out);
  }
};

}  // namespace

TEST_CASE("two hands press in virtual time, half a period apart, each with its own limits and tool",
          "[two_hands]") {
  const VirtualRun run = run_virtual();
  CHECK(run.result.exit_code == 0);
  REQUIRE(run.first.ticks.size() == 3001);  // one more for the release at the end
  REQUIRE(run.left.ticks.size() >= 3000);
  for (std::size_t i = 0; i < 2999; ++i)
    REQUIRE(run.left.ticks[i].now_ns - run.first.ticks[i].now_ns == 500'000);
  CHECK(largest_force_N(run.first) > 0.5);
  CHECK(largest_force_N(run.left) > 0.5);
  CHECK(largest_force_N(run.left) <= 2.0 + 1e-9);
  CHECK(run.left.ticks[1000].X_WP[1] - run.first.ticks[1000].X_WP[1] == Approx(0.15).margin(0.01));
  CHECK_THAT(run.result.err, Contains("left: state: active") && Contains("info state: active"));
  // A tool that leaves the world with its hand is searched for by nobody.
  const std::string after = run.result.err.substr(run.result.err.find("state: shutdown"));
  CHECK_THAT(after, !Contains("proxy initialization"));
}

TEST_CASE("two runs of two hands in virtual time give the same ticks", "[two_hands]") {
  const VirtualRun one = run_virtual(), two = run_virtual();
  CHECK(same(one.first, two.first));
  CHECK(same(one.left, two.left));
  CHECK(one.first.ticks.size() == two.first.ticks.size());
}

TEST_CASE("a first hand beside a second one that it does not touch feels what it feels alone",
          "[two_hands]") {
  const TemporaryDirectory dir;
  const auto file = dir.path() / "alone.h5";
  dir.write("alone.toml", "");
  REQUIRE(run_program("wrenchd", {"--config", (dir.path() / "alone.toml").string(), "--virtual-time",
                                  "--seconds", "3", "--arm", "--record", file.string()})
              .exit_code == 0);
  const Recording alone = read_recording(file), beside = run_virtual().first;
  REQUIRE(alone.ticks.size() == beside.ticks.size());
  // The clearances differ by a nanometre, so an encoder may count a step sooner: such ticks are left out.
  std::size_t compared = 0;
  double largest_m = 0.0, largest_N = 0.0;
  for (std::size_t i = 0; i < alone.ticks.size(); ++i) {
    const TickRecord &a = alone.ticks[i], &b = beside.ticks[i];
    REQUIRE(a.state == b.state);
    if (a.proxy_initialization != static_cast<std::uint8_t>(ProxyInitialization::complete)) continue;
    if (!same_bits(a.X_WP, b.X_WP)) continue;
    ++compared;
    for (std::size_t k = 0; k < 3; ++k) {
      largest_m = std::max(largest_m, std::abs(a.X_WQ[k] - b.X_WQ[k]));
      largest_N = std::max(largest_N, std::abs(a.F_out[k] - b.F_out[k]));
    }
  }
  CHECK(compared > 2000);
  CHECK(largest_m < 1e-8);
  CHECK(largest_N < 2e-2);  // what was sent before the encoders agreed again limits the slope of the force
}

TEST_CASE("a hand whose device is unplugged in virtual time comes back, and the other goes on",
          "[two_hands]") {
  const TemporaryDirectory dir;
  const auto script = dir.write("script.toml", "[[fault]]\nkind = 'unplug'\nat_s = 1.5\nfor_s = 0.5\n");
  const VirtualRun run = run_virtual({"--loopback-script", script.string()});
  INFO(run.result.err);
  CHECK(run.first.ticks.size() < 2600);
  CHECK(run.left.ticks.size() >= 3000);
  CHECK(static_cast<State>(run.left.ticks.back().state) == State::shutdown);
  CHECK_THAT(run.result.err, Contains("the simulated device was unplugged; waiting for it") &&
                                 Contains("the device is connected again, and is disarmed") &&
                                 !Contains("left: the simulated device was unplugged"));
}

TEST_CASE("a recording of two hands says so, has the configuration of its hand, and replays with the other",
          "[two_hands]") {
  const VirtualRun run = run_virtual();
  CHECK(run.first.header.hands == 2);
  CHECK(run.first.header.hand.empty());
  CHECK(run.left.header.hands == 2);
  CHECK(run.left.header.hand == "left");
  CHECK(run.left.header.settings == run.first.header.settings);  // the whole text
  const RecordedRun first(run.first.header), left(run.left.header);
  CHECK(first.config().settings.limits.max_force_N == 0.0);
  CHECK(left.config().settings.limits.max_force_N == 2.0);
  CHECK(left.config().settings.device.base_in_world.position_m.y() == 0.15);
  CHECK(left.config().scene.tool.generated.has_value());
  CHECK_FALSE(first.config().scene.tool.generated.has_value());

  const TemporaryDirectory dir;
  const std::string file = (dir.path() / "run.h5").string();
  run_program("wrenchd", {"--config", write_config(dir).string(), "--virtual-time", "--seconds", "0.1",
                          "--record", file});
  const std::string left_file = (dir.path() / "run-left.h5").string();
  for (const std::string& named : {file, left_file}) {
    const ProgramResult replay = run_program("wrenchctl", {"replay", named});
    INFO(replay.err);
    CHECK(replay.exit_code == 0);
    CHECK_THAT(replay.out, Contains("201 ticks, all bits are equal"));
  }
  const auto moved = dir.path() / "alone.h5";
  std::filesystem::rename(left_file, moved);
  const ProgramResult lacking = run_program("wrenchctl", {"replay", file});
  CHECK(lacking.exit_code != 0);
  CHECK_THAT(lacking.err, Contains("run-left.h5"));
  const ProgramResult renamed = run_program("wrenchctl", {"replay", moved.string()});
  CHECK(renamed.exit_code != 0);
  CHECK_THAT(renamed.err, Contains("its name must end in -left.h5"));
  const ProgramResult named =
      run_program("wrenchctl", {"replay", file, "--scene", "scenes/cube_on_table.toml"});
  CHECK(named.exit_code != 0);
  CHECK_THAT(named.err, Contains("leave out --config, --scene and --profile"));
}

TEST_CASE("the live view names the lines of the second hand", "[two_hands]") {
  const VirtualRun run = run_virtual({"--live"});
  CHECK_THAT(run.result.out, Contains("\nleft:    1.00 s ") && Contains("\nleft: 2999 ticks in ") &&
                                 Contains("\n3000 ticks in "));
}

TEST_CASE("check accepts a configuration with two hands", "[two_hands]") {
  const TemporaryDirectory dir;
  const ProgramResult result = run_program("wrenchctl", {"check", write_config(dir).string()});
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.out, Contains("second hand left:\n  device loopback") && Contains("tool made sphere"));
}

TEST_CASE("each of two hands has a control socket with its own state, lease and recordings",
          "[two_hands][wall_time]") {
  TwoHandDaemon daemon;
  CHECK(TwoHandDaemon::status(daemon.socket)["hand"].is_null());
  const Json left = TwoHandDaemon::status(daemon.socket_of_left);
  CHECK(left["hand"] == "left");
  CHECK(left["limits"]["max_force_N"] == 2.0);

  for (const std::string& one : {daemon.socket, daemon.socket_of_left})
    CHECK(TwoHandDaemon::ctl({"record", "start", "mine"}, one).exit_code == 0);
  CHECK(fs::exists(daemon.dir.path() / "rec/mine.h5"));
  CHECK(fs::exists(daemon.dir.path() / "rec/mine-left.h5"));

  CHECK(TwoHandDaemon::ctl({"stop"}, daemon.socket_of_left).exit_code == 0);
  CHECK(TwoHandDaemon::status(daemon.socket_of_left)["state"] == "stopped");
  CHECK(TwoHandDaemon::status(daemon.socket)["state"] == "disarmed");
  CHECK(daemon.program.wait_for_output("-stop_requested-left.h5"));

  daemon.program.signal(SIGUSR2);
  CHECK(soon([&] { return TwoHandDaemon::status(daemon.socket_of_left)["state"] == "disarmed"; }));
  daemon.program.signal(SIGUSR1);  // stops both
  for (const std::string& one : {daemon.socket, daemon.socket_of_left})
    CHECK(soon([&] { return TwoHandDaemon::status(one)["state"] == "stopped"; }));
  daemon.program.signal(SIGUSR2);
  for (const std::string& one : {daemon.socket, daemon.socket_of_left})
    CHECK(soon([&] { return TwoHandDaemon::status(one)["state"] == "disarmed"; }));

  daemon.program.signal(SIGTERM);
  const ProgramResult end = daemon.program.wait();
  INFO(end.err);
  CHECK(end.exit_code == 0);
  CHECK_THAT(end.err, Contains("info the hand is released: zero wrench, motors off") &&
                          Contains("left: the hand is released: zero wrench, motors off"));
  CHECK_FALSE(fs::exists(daemon.socket_of_left));
}

TEST_CASE("what two hands share does not change while they run", "[two_hands][wall_time]") {
  TwoHandDaemon daemon;
  const std::string cure = "change the file and start wrenchd again";
  for (const std::string& one : {daemon.socket, daemon.socket_of_left})
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"reload"}, {"scene", "load", "scenes/dominoes.toml"}}) {
      const ProgramResult result = TwoHandDaemon::ctl(words, one);
      INFO(result.out << result.err);
      CHECK(result.exit_code != 0);
      CHECK_THAT(result.err, Contains(cure));
    }
  daemon.program.signal(SIGHUP);
  CHECK(daemon.program.wait_for_output("error reload: rejected, nothing changes: two hands share"));
  daemon.program.signal(SIGTERM);
  CHECK(daemon.program.wait().exit_code == 0);
}

TEST_CASE("a second hand that cannot start ends the first one too", "[two_hands][wall_time]") {
  const TemporaryDirectory dir;
  const auto file = (dir.path() / "run.h5").string();
  dir.write("run-left.h5", "a recording is never overwritten");
  const ProgramResult result =
      run_program("wrenchd", {"--realtime", "best_effort", "--config", write_config(dir).string(),
                              "--control", "none", "--record", file});
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Contains("run-left.h5"));
}

}  // namespace wrenchd::test_two_hands
