// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/control/json_rpc.hpp"
#include "tests/support/run_program.hpp"

namespace wrenchd::test {

/// wrenchd in wall time whose simulated hand rests above the table, and wrenchctl on its socket.
struct RunningDaemon {
  TemporaryDirectory dir;
  std::string socket = (dir.path() / "control.sock").string();
  RunningProgram program;

  RunningDaemon() : program("wrenchd", arguments()) {
    INFO(program.err());
    REQUIRE(program.wait_for_output("control socket: " + socket));
  }

  /// Runs wrenchctl with these words.
  ProgramResult ctl(std::vector<std::string> words) const {
    words.insert(words.end(), {"--socket", socket});
    return run_program("wrenchctl", words);
  }
  /// Runs wrenchctl with --json. Returns its output.
  Json ask(std::vector<std::string> words) const {
    words.emplace_back("--json");
    const ProgramResult result = ctl(words);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return Json::parse(result.out);
  }

 private:
  std::vector<std::string> arguments() const {
    dir.write("hand.toml", "repeats = false\n[[waypoint]]\ntime_s = 0.0\nposition_m = [0.0, 0.0, 0.065]\n");
    const auto config =
        dir.write("wrenchd.toml", "[servo]\nself_test_s = 0.1\n[simulation]\nhand_script = \"hand.toml\"\n");
    return {"--realtime", "best_effort", "--config", config.string(), "--control", socket};
  }
};

}  // namespace wrenchd::test
