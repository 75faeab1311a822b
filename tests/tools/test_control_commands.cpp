// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>

#include <catch2/catch.hpp>

#include "daemon/control/json_rpc.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd::test_control_commands {

// wrenchctl and the daemon as two processes.

namespace {

using namespace test;

constexpr const char* kStillHand =
    "repeats = false\n[[waypoint]]\ntime_s = 0.0\nposition_m = [0.0, 0.0, 0.065]\n";

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  CHECK(text.find(part) != std::string::npos);
  return text.find(part) != std::string::npos;
}

/// A daemon whose simulated hand rests above the table, ready to arm.
struct Daemon {
  TemporaryDirectory dir;
  std::string socket = (dir.path() / "control.sock").string();
  RunningProgram program;

  explicit Daemon(const std::string& profile = "loopback") : program("wrenchd", arguments(profile)) {
    INFO(program.err());
    REQUIRE(program.wait_for_output("control socket: " + socket));
  }
  /// Returns true after the self-test.
  bool starts() const { return program.wait_for_output("state: disarmed"); }

  ProgramResult ctl(std::vector<std::string> words) const {
    words.insert(words.begin() + 1, {"--socket", socket});
    return run_program("wrenchctl", words);
  }
  std::string state() const { return Json::parse(ctl({"status", "--json"}).out)["state"]; }
  /// Returns true when the daemon is in another state.
  bool leaves(const std::string& state) const {
    for (int i = 0; i < 200; ++i) {
      if (this->state() != state) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }
  bool comes_to(const std::string& state) const {
    for (int i = 0; i < 200; ++i) {
      if (this->state() == state) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }

 private:
  std::vector<std::string> arguments(const std::string& profile) const {
    dir.write("hand.toml", kStillHand);
    const auto config = dir.write(
        "wrenchd.toml", "[limits]\nsoft_start_s = 0.25\n[simulation]\nhand_script = \"hand.toml\"\n");
    return {"--realtime", "best_effort", "--config",   config.string(),
            "--control",  socket,        "--simulate", profile};
  }
};

TEST_CASE("wrenchctl status prints text for a user and JSON for a program", "[control_commands]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  const ProgramResult text = daemon.ctl({"status"});
  CHECK(text.exit_code == 0);
  for (const char* part :
       {"state      disarmed\n", "device     loopback (simulated), present\n", "armed by   -\n",
        "lease      free\n", "limits     10 N, 0.5 N.m\n", "at 1000 Hz", "(p50 / p99.9 / max)"})
    has(text.out, part);
  const ProgramResult json = daemon.ctl({"status", "--json"});
  CHECK(json.exit_code == 0);
  const Json status = Json::parse(json.out);
  CHECK(status["state"] == "disarmed");
  CHECK(status["device"]["profile"] == "loopback");
  CHECK(status["tick"] > 0);
}

TEST_CASE("wrenchctl status reports that a device without motors applies no force", "[control_commands]") {
  const MachineLoad load;
  const Daemon daemon("spacemouse_split");
  REQUIRE_RATE(load, daemon.starts());
  has(daemon.ctl({"status"}).out, "limits     0 N, 0 N.m: the device has no motors and applies no force\n");
}

TEST_CASE("wrenchctl arm keeps the force until a signal, while other clients watch",
          "[control_commands][wall_time]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  RunningProgram watch("wrenchctl", {"watch", "--socket", daemon.socket, "--json"});
  for (int i = 0; i < 500 && watch.out().empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  RunningProgram arm("wrenchctl", {"arm", "--socket", daemon.socket});
  REQUIRE_RATE(load, daemon.comes_to("active"));
  const Json status = Json::parse(daemon.ctl({"status", "--json"}).out);
  has(status["armed_by"], "process ");

  const ProgramResult second = daemon.ctl({"disarm"});
  CHECK(second.exit_code == 0);
  const ProgramResult disarmed = arm.wait();
  CHECK(disarmed.exit_code == 1);
  has(disarmed.err, "the daemon has disarmed");

  RunningProgram again("wrenchctl", {"arm", "--socket", daemon.socket});
  REQUIRE_RATE(load, daemon.comes_to("active"));
  const ProgramResult other = daemon.ctl({"arm"});
  CHECK(other.exit_code == 1);
  has(other.err, "wrenchctl: The lease is held by process ");
  again.signal(SIGINT);
  const ProgramResult result = again.wait();
  CHECK(result.exit_code == 0);
  has(result.out, "state: releasing");
  has(result.out, "state: disarmed");
  CHECK(daemon.state() == "disarmed");

  watch.signal(SIGTERM);
  const ProgramResult seen = watch.wait();
  CHECK(seen.exit_code == 0);
  std::istringstream lines(seen.out);
  std::string line;
  REQUIRE(std::getline(lines, line));
  auto last = Json::parse(line)["sequence"].get<std::uint64_t>();
  std::string states;
  while (std::getline(lines, line)) {
    const Json event = Json::parse(line);
    CHECK(event["sequence"] == ++last);
    if (event["name"] == "state") states += event["state"].get<std::string>() + " ";
  }
  // A late tick may degrade the daemon in between.
  REQUIRE_RATE(load, states.find("waiting ramping active releasing disarmed waiting ramping active releasing "
                                 "disarmed ") != std::string::npos);
}

TEST_CASE("a wrenchctl that is killed releases the hand", "[control_commands][wall_time]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  RunningProgram arm("wrenchctl", {"arm", "--socket", daemon.socket});
  REQUIRE_RATE(load, daemon.comes_to("active"));
  SECTION("killed") {
    arm.signal(SIGKILL);
    CHECK(daemon.leaves("active"));  // whatever the load
    REQUIRE_RATE(load, daemon.program.wait_for_output("disconnected", std::chrono::seconds(5)));
  }
  SECTION("stopped") {
    arm.signal(SIGSTOP);
    CHECK(daemon.leaves("active"));  // whatever the load
    REQUIRE_RATE(load, daemon.program.wait_for_output("sends no heartbeat", std::chrono::seconds(5)));
  }
  REQUIRE_RATE(load, daemon.program.wait_for_output("heartbeat_lost: ", std::chrono::seconds(5)));
  REQUIRE_RATE(load, daemon.comes_to("disarmed"));
}

TEST_CASE("wrenchctl stops, and acknowledges", "[control_commands]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  CHECK(daemon.ctl({"acknowledge"}).exit_code == 1);
  const ProgramResult stop = daemon.ctl({"stop"});
  CHECK(stop.exit_code == 0);
  has(stop.out, "requested: stop; state stopped");
  has(daemon.ctl({"status"}).out, "cause      stop_requested: ");
  Json status = Json::parse(daemon.ctl({"status", "--json"}).out);
  status["before_cause"] = {{{"name", "motors_off"}, {"message", "off"}, {"cure", "switch them on"}}};
  has(status_text(status), "\nbefore it  motors_off: off\n           switch them on\n");
  const ProgramResult arm = daemon.ctl({"arm"});
  CHECK(arm.exit_code == 1);
  has(arm.err, "The loop cannot be armed in state 'stopped': acknowledge the fault or stop first.");
  CHECK(daemon.ctl({"acknowledge"}).exit_code == 0);
  REQUIRE_RATE(load, daemon.comes_to("disarmed"));
}

TEST_CASE("wrenchctl describe lists methods and roles", "[control_commands]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  const ProgramResult all = daemon.ctl({"describe"});
  CHECK(all.exit_code == 0);
  for (const char* part : {"lease.acquire  (operator)\n", "stop  (observer)\n", "\nevents\n", "\nroles\n",
                           "preempt: true or false, optional; "})
    has(all.out, part);
  const ProgramResult one = daemon.ctl({"describe", "arm"});
  CHECK(one.out.find("arm  (operator)\n") == 0);
  CHECK(one.out.find("stop") == std::string::npos);
  const ProgramResult none = daemon.ctl({"describe", "dance"});
  CHECK(none.exit_code == 1);
  has(none.err, "there is no method 'dance'; wrenchctl describe without a name lists the methods");
  has(daemon.ctl({"describe", "lease.aquire"}).err,
      "there is no method 'lease.aquire'; did you mean 'lease.acquire'?");
}

TEST_CASE("wrenchctl names the searched sockets and the remedy", "[control_commands]") {
  const TemporaryDirectory dir;
  const std::string socket = (dir.path() / "control.sock").string();
  const ProgramResult gone = run_program("wrenchctl", {"status", "--socket", socket});
  CHECK(gone.exit_code == 1);
  CHECK(gone.out == "");
  has(gone.err, "wrenchctl: no wrenchd responds (" + socket + ": No such file or directory); start it");
  const ProgramResult usual = run_program("wrenchctl", {"arm"});  // tests have $WRENCHD_SOCKET set to none
  CHECK(usual.exit_code == 1);
  has(usual.err, "no wrenchd responds (none: ");
}

TEST_CASE("a second daemon does not start on an occupied socket, and states the reason",
          "[control_commands]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.starts());
  const ProgramResult second =
      run_program("wrenchd", {"--realtime", "off", "--seconds", "0.1", "--control", daemon.socket});
  CHECK(second.exit_code == 1);
  has(second.err, "another wrenchd listens there; stop it, or name another path with --control");
  CHECK(daemon.state() == "disarmed");
  has(run_program("wrenchd", {"--realtime", "off", "--seconds", "0.1", "--control", "here.sock"}).err,
      "wrenchd: --control: expected an absolute path, or \"none\", found \"here.sock\"");
  const TemporaryDirectory dir;
  const auto config = dir.write("wrenchd.toml", "[control]\noperators = \"no-such-group-here\"\n");
  const ProgramResult group = run_program("wrenchd", {"--realtime", "off", "--seconds", "0.1", "--config",
                                                      config.string(), "--control", daemon.socket + "2"});
  CHECK(group.exit_code == 1);
  has(group.err,
      "key 'control.operators': this machine has no group 'no-such-group-here'; create it with: groupadd");
}

TEST_CASE("any operator can disarm a daemon that its command line armed", "[control_commands]") {
  const TemporaryDirectory dir;
  const std::string socket = (dir.path() / "control.sock").string();
  const MachineLoad load;
  const RunningProgram program("wrenchd", {"--realtime", "off", "--arm", "--control", socket});
  REQUIRE_RATE(load, program.wait_for_output("state: waiting"));
  const Json status = Json::parse(run_program("wrenchctl", {"status", "--json", "--socket", socket}).out);
  CHECK(status["armed_by"] == "command line");
  CHECK(run_program("wrenchctl", {"disarm", "--socket", socket}).exit_code == 0);
  REQUIRE_RATE(load, program.wait_for_output("state: disarmed"));
}

}  // namespace
}  // namespace wrenchd::test_control_commands
