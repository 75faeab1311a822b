// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include <catch2/catch.hpp>
#include <sys/wait.h>

#include "tests/support/paths.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/stub_daemon.hpp"

namespace wrenchd::test_python_client {

using namespace wrenchd::test;

namespace {

struct Ran {
  int exit_code;
  std::string out;
};

/// A Python program of the tree, with the package of the tree, as a client of the daemon at this socket.
Ran run_python(const std::string& socket, const std::string& program) {
  const std::string command = "WRENCHD_SOCKET=" + socket +
                              " PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" + source_path("tools/python") +
                              " timeout 120 python3 -W error " + source_path(program) + " 2>&1";
  FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::string out;
  std::array<char, 4096> bytes;
  for (std::size_t got; (got = fread(bytes.data(), 1, bytes.size(), pipe)) > 0;)
    out.append(bytes.data(), got);
  const int status = pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out};
}

std::string contents(const std::string& name) {
  std::ifstream in(source_path(name));
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

}  // namespace

TEST_CASE("the Python package passes its own checks", "[python]") {
  StubDaemon daemon;
  const Ran ran = run_python(daemon.socket(), "tests/python/check_client.py");
  INFO(ran.out);
  CHECK(ran.exit_code == 0);
  CHECK(ran.out.find("Ran ") != std::string::npos);
}

TEST_CASE("the Python client reads 1,000 consecutive ticks while the machine is loaded",
          "[python][wall_time]") {
  StubDaemon daemon;
  const Ran ran = run_python(daemon.socket(), "tests/python/consecutive_ticks.py");
  INFO(ran.out);
  // The script loads the machine itself and has ended by now, so this measures other programs' load only.
  REQUIRE_RATE(MachineLoad(), ran.exit_code == 0);
  CHECK(ran.out.find("1000 ticks in ") == 0);
}

TEST_CASE("the Python example works as printed", "[python]") {
  StubDaemon daemon;
  const Ran ran = run_python(daemon.socket(), "tools/python/example.py");
  INFO(ran.out);
  CHECK(ran.exit_code == 0);
  CHECK(ran.out.find("wrenchd is disarmed\n") == 0);
  CHECK(ran.out.find("\nticks missed: 0\n") != std::string::npos);
}

TEST_CASE("the clients work with wrenchd itself", "[python][program][wall_time]") {
  const TemporaryDirectory directory;
  const std::string socket = (directory.path() / "control.sock").string();
  RunningProgram wrenchd("wrenchd", {"--config", source_path("config/wrenchd.toml"), "--control", socket,
                                     "--realtime", "best_effort"});
  REQUIRE(wrenchd.wait_for_output("control socket"));
  for (const std::string program :
       {"tools/python/example.py", "tests/python/consecutive_ticks.py", "tests/python/check_client.py"}) {
    const Ran ran = run_python(socket, program);
    INFO(program << ":\n" << ran.out << wrenchd.err());
    REQUIRE_RATE(MachineLoad(), ran.exit_code == 0);
  }
  setenv("WRENCHD_SOCKET", socket.c_str(), 1);
  const ProgramResult example = run_program("wrenchd_client_example", {"3"});
  unsetenv("WRENCHD_SOCKET");
  INFO(example.out << example.err);
  REQUIRE_RATE(MachineLoad(), example.exit_code == 0);
  wrenchd.signal(SIGTERM);
  CHECK(wrenchd.wait().exit_code == 0);
}

TEST_CASE("a program of 15 lines steers the simulated hand against the table",
          "[python][program][wall_time]") {
  const TemporaryDirectory directory;
  const std::string socket = (directory.path() / "control.sock").string();
  const auto config = directory.write("config/wrenchd.toml", "[servo]\nself_test_s = 0\n");
  RunningProgram wrenchd("wrenchd",
                         {"--config", config.string(), "--control", socket, "--realtime", "best_effort"});
  REQUIRE(wrenchd.wait_for_output("control socket"));
  const Ran ran = run_python(socket, "tools/python/steer_hand.py");
  INFO(ran.out << wrenchd.err());
  REQUIRE_RATE(MachineLoad(), ran.exit_code == 0);
  std::istringstream lines(ran.out);
  std::string line, last;
  int count = 0;
  for (; std::getline(lines, line); ++count) last = line;
  CHECK(count == 8);
  double force_N = 0.0, x_m = 0.0, y_m = 0.0, z_m = 0.0;
  const std::size_t numbers = last.find("at ("), force = last.find("force (");
  REQUIRE_RATE(MachineLoad(), last.starts_with("active"));
  REQUIRE(std::sscanf(last.c_str() + numbers, "at (%lf, %lf, %lf)", &x_m, &y_m, &z_m) == 3);
  double fx_N = 0.0, fy_N = 0.0;
  REQUIRE(std::sscanf(last.c_str() + force, "force (%lf, %lf, %lf)", &fx_N, &fy_N, &force_N) == 3);
  CHECK(z_m == Approx(0.025).margin(1e-6));  // the cube of 50 mm lies on the table
  CHECK(std::hypot(x_m, y_m) == Approx(0.03).margin(2e-3));
  CHECK(force_N > 0.8);
}

TEST_CASE("the Python programs in the guide are the examples", "[python]") {
  const std::string guide = contents("tools/README.md");
  for (const auto& [name, most] :
       {std::pair{"tools/python/example.py", 10}, {"tools/python/steer_hand.py", 15}}) {
    std::istringstream example(contents(name));
    std::string printed;
    int lines = 0;
    for (std::string line; std::getline(example, line);) {
      if (line.starts_with("#")) continue;
      printed += line + "\n";
      lines += line.empty() ? 0 : 1;
    }
    CHECK(lines <= most);
    CHECK(guide.find(printed) != std::string::npos);
  }
}

}  // namespace wrenchd::test_python_client
