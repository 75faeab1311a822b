// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/recording/recording_file.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_mujoco_arm {

using namespace std::chrono_literals;

namespace {

using namespace test;

double force_N(const TickRecord::Numbers6& F) {
  return std::hypot(F[0], F[1], F[2]);
}

}  // namespace

TEST_CASE("a robot arm in MuJoCo acts on the hand, and its death in contact leaves no kick",
          "[mujoco][external_wrench][wall_time]") {
  const MachineLoad load;
  const TemporaryDirectory directory;
  const std::string socket = (directory.path() / "control.sock").string();
  const auto recording_file = directory.path() / "run.h5";
  const auto config =
      directory.write("wrenchd.toml", "[servo]\nself_test_s = 0.1\n[limits]\nsoft_start_s = 0.25\n");
  RunningProgram wrenchd("wrenchd", {"--config", config.string(), "--control", socket, "--realtime",
                                     "best_effort", "--arm", "--record", recording_file.string()});
  REQUIRE(wrenchd.wait_for_output("control socket: " + socket));
  setenv("WRENCHD_SOCKET", socket.c_str(), 1);
  RunningProgram arm("wrenchd_mujoco_arm", {});
  unsetenv("WRENCHD_SOCKET");
  REQUIRE_RATE(load, soon([&] { return arm.out().find("on the hand") != std::string::npos; }));
  std::this_thread::sleep_for(3s);  // the shipped hand presses the cube on the table
  arm.signal(SIGKILL);
  std::this_thread::sleep_for(500ms);
  wrenchd.signal(SIGTERM);
  REQUIRE_RATE(load, wrenchd.wait().exit_code == 0);  // a loop that runs late ends with a fault

  const Recording recording = read_recording(recording_file);
  const std::vector<TickRecord>& ticks = recording.ticks;
  const auto pulls = [](const TickRecord& tick) { return force_N(tick.F_external) > 0.2; };
  REQUIRE_RATE(load, std::count_if(ticks.begin(), ticks.end(), pulls) > 500);
  REQUIRE_RATE(load, std::any_of(ticks.begin(), ticks.end(),
                                 [&](const TickRecord& tick) { return pulls(tick) && tick.contacts > 0; }));

  const auto last_request = std::find_if(
      ticks.rbegin(), ticks.rend(), [](const TickRecord& tick) { return tick.external_expires_ns != 0; });
  REQUIRE(last_request != ticks.rend());
  const std::int64_t expired_ns = last_request->external_expires_ns;
  // The arm asks for 4 N at most. They fade within 50 ms; 10 ms more for ticks that come late.
  double beyond_fade_N = 0.0, smallest_J = 0.0;
  for (auto tick = last_request.base(); tick != ticks.end(); ++tick) {
    smallest_J = std::min(smallest_J, tick->external_balance_J);
    const double since_s = 1e-9 * static_cast<double>(tick->now_ns - expired_ns);
    const double fade = std::clamp(1.0 - (since_s - 0.010) / 0.050, 0.0, 1.0);
    beyond_fade_N = std::max(beyond_fade_N, force_N(tick->F_external) - 4.0 * fade);
  }
  REQUIRE_RATE(load, beyond_fade_N <= 1e-9);
  CHECK(smallest_J > -1e-6);
}

}  // namespace wrenchd::test_mujoco_arm
