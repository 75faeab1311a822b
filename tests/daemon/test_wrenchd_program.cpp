// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/sample_meshes.hpp"

namespace wrenchd::test_wrenchd_program {

namespace {

namespace fs = std::filesystem;
using namespace test;

constexpr const char* kReleased = "the hand is released: zero wrench, motors off";

/// Runs wrenchd in virtual time, so that the result is the same on every machine.
ProgramResult run_virtual(std::vector<std::string> more) {
  more.insert(more.begin(), {"--virtual-time", "--seconds", "5"});
  return run_program("wrenchd", more);
}

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST_CASE("wrenchd shows contact and a plausible force on the simulated device") {
  const ProgramResult result = run_virtual({"--arm", "--live"});
  INFO(result.out << result.err);
  CHECK(result.exit_code == 0);
  const auto lines = lines_of(result.out);
  REQUIRE(lines.size() > 10);
  int free = 0, in_contact = 0;
  double most_force_N = 0.0;
  for (const std::string& line : lines) {
    if (line.find(" s active ") == std::string::npos && line.find(" s ramping ") == std::string::npos)
      continue;
    const bool contact = line.find("| 0 contacts |") == std::string::npos;
    ++(contact ? in_contact : free);
    // F x y z: the table pushes up, and only in contact.
    double x = 0, y = 0, z = 0;
    REQUIRE(std::sscanf(line.c_str() + line.find("| F ") + 4, "%lf %lf %lf", &x, &y, &z) == 3);
    CHECK((contact ? z > 0.0 : std::abs(x) + std::abs(y) + std::abs(z) == 0.0));
    most_force_N = std::max(most_force_N, z);
  }
  CHECK(free > 0);
  CHECK(in_contact > 3);
  CHECK(most_force_N > 0.5);    // the hand presses
  CHECK(most_force_N <= 10.0);  // the profile's limit
  CHECK(result.out.find("5000 ticks in 5.00 s (1000.0 Hz); in contact in ") != std::string::npos);
  CHECK(result.out.find("overruns 0, skipped ticks 0") != std::string::npos);
  CHECK(result.err.find("device loopback, tool of 8 hull vertices, 1 obstacles, 1000 Hz") !=
        std::string::npos);
  CHECK(result.err.find("state: active") != std::string::npos);
  CHECK(result.err.find(kReleased) != std::string::npos);
}

TEST_CASE("wrenchd simulates the device of a real device's profile") {
  const ProgramResult result = run_virtual({"--arm", "--live", "--simulate", "reference_full_speed"});
  CHECK(result.exit_code == 0);
  CHECK(result.err.find("device reference_full_speed,") != std::string::npos);
  CHECK(result.err.find("state: active") != std::string::npos);
  CHECK(result.err.find(kReleased) != std::string::npos);
}

TEST_CASE("wrenchd simulates devices of every kind, and renders with the motors they have") {
  for (const std::string profile : {"polhem", "falcon"}) {
    const ProgramResult result = run_program(
        "wrenchd", {"--arm", "--live", "--simulate", profile, "--virtual-time", "--seconds", "6"});
    INFO(profile << "\n" << result.err << result.out);
    CHECK(result.exit_code == 0);
    CHECK(result.err.find("state: active") != std::string::npos);
    CHECK(result.out.find("largest force 0.00 N") == std::string::npos);
    CHECK(result.out.find("torque 0.0 mN.m") != std::string::npos);
  }
  const ProgramResult mouse = run_program(
      "wrenchd", {"--arm", "--live", "--simulate", "spacemouse_split", "--virtual-time", "--seconds", "6"});
  CHECK(mouse.exit_code == 0);
  CHECK(mouse.out.find("in contact in 0 ticks") == std::string::npos);
  CHECK(mouse.err.find("the device has no motors") != std::string::npos);
  CHECK(mouse.out.find(" mN.m on the tool (no motors) | tick ") != std::string::npos);
  CHECK(mouse.out.find("largest force 0.00 N") == std::string::npos);
  CHECK(mouse.out.find(" on the tool, not sent: no motors\n") != std::string::npos);
}

TEST_CASE("two runs of wrenchd in virtual time print the same") {
  const ProgramResult one = run_virtual({"--arm", "--live"}), two = run_virtual({"--arm", "--live"});
  CHECK(one.exit_code == 0);
  CHECK(one.out == two.out);
}

TEST_CASE("wrenchd measures and sends zero force while it is not armed") {
  const ProgramResult result = run_virtual({"--live"});
  CHECK(result.exit_code == 0);
  CHECK(result.out.find(" s disarmed ") != std::string::npos);
  CHECK(result.out.find(" s active ") == std::string::npos);
  CHECK(result.out.find("largest force 0.00 N, torque 0.0 mN.m") != std::string::npos);
  CHECK(result.err.find(kReleased) != std::string::npos);
}

TEST_CASE("wrenchd prints nothing on standard output without --live") {
  const ProgramResult result = run_virtual({"--arm"});
  CHECK(result.exit_code == 0);
  CHECK(result.out == "");
}

TEST_CASE("wrenchd accepts another scene, configuration and profile") {
  const TemporaryDirectory dir;
  dir.write("body.obj", as_obj(box({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02})));
  const fs::path scene = dir.write("scene.toml", "[tool]\nmesh = \"body.obj\"\nmass = 0.1\n");
  const fs::path config = dir.write("config.toml", "[servo]\nrate_Hz = 2000\n");
  const ProgramResult result = run_virtual(
      {"--arm", "--live", "--scene", scene.string(), "--config", config.string(), "--profile", "loopback"});
  INFO(result.err);
  CHECK(result.exit_code == 0);
  CHECK(result.err.find("tool of 8 hull vertices, 0 obstacles, 2000 Hz") != std::string::npos);
  CHECK(result.out.find("10000 ticks in 5.00 s (2000.0 Hz); in contact in 0 ticks") != std::string::npos);
}

TEST_CASE("wrenchd rejects invalid files with their location, and starts nothing") {
  const TemporaryDirectory dir;
  const std::string box_off = as_off(box({0, 0, 0}, {1, 1, 1}));
  dir.write("body.off", box_off);
  dir.write("open.off", as_off({box({0, 0, 0}, {1, 1, 1}).vertices, {{0, 4, 6, 2}}}));
  const auto profile = contents(test::source_path("config/profiles/loopback.toml"));
  const auto file = [&](const std::string& name, const std::string& text) {
    return dir.write(name, text).string();
  };
  const std::string missing = (dir.path() / "missing.toml").string();
  struct {
    std::vector<std::string> arguments;
    std::string reason;
  } const table[] = {
      {{"--config", missing}, "missing.toml: no such file"},
      {{"--config", dir.path().string()}, ": is a directory; name a file in it"},
      {{"--config", file("typo.toml", "[servo]\nrat_Hz = 1000\n")},
       "typo.toml:2:1: key 'servo.rat_Hz' is not known; did you "
       "mean 'rate_Hz'?"},
      {{"--config", file("range.toml", "[servo]\nrate_Hz = 9000\n")},
       "range.toml:2:11: key 'servo.rate_Hz': expected"},
      {{"--config", file("nan.toml", "[servo]\nrate_Hz = nan\n")},
       "nan.toml:2:11: key 'servo.rate_Hz': expected"},
      {{"--config", file("scene_gone.toml", "scene = \"gone.toml\"\n")},
       "scene_gone.toml:1:9: key 'scene': no such file"},
      {{"--scene", missing}, "missing.toml: no such file"},
      {{"--scene", file("normal.toml",
                        "[tool]\nmesh = \"body.off\"\n[[obstacle]]\nhalf_space = { normal = [0, 0, 0], "
                        "offset = 0 }\n")},
       "normal.toml:4:25: key 'obstacle[0].half_space.normal': must not be zero"},
      {{"--scene", file("mesh.toml", "[tool]\nmesh = \"gone.off\"\n")},
       "mesh.toml:2:8: key 'tool.mesh': no such file"},
      {{"--scene", file("open.toml", "[tool]\nmesh = \"open.off\"\n")},
       "open.off: is not a closed, consistently oriented "
       "solid"},
      {{"--profile", "gone"}, "gone.toml: no such file"},
      {{"--profile", file("limits.toml", std::string(profile).erase(profile.find("max_force_N"), 11))},
       "limits.toml:"},
      {{"--profile", file("empty.toml", "")}, "empty.toml:1:1: key 'limits' is missing"},
      {{"--profile", "reference_full_speed"},
       "--virtual-time: a real device runs in real time; simulate a device, for example with --simulate "
       "reference_full_speed"},
      {{"--profile", "auto"}, "simulate a device, for example with --simulate loopback"},
      {{"--simulate", "gone"}, "gone.toml: no such file"},
      {{"--simulate", "auto"}, "--simulate auto: name the profile to simulate, as in --simulate loopback"},
      {{"--record", (dir.path() / "gone/run.h5").string()},
       "run.h5: cannot be created; check that the directory exists"},
  };
  for (const auto& [arguments, reason] : table) {
    const ProgramResult result = run_virtual(arguments);
    INFO(reason << "\ngot " << result.err);
    CHECK(result.exit_code == 1);
    CHECK(result.out == "");
    CHECK(result.err.find("wrenchd: ") != std::string::npos);
    CHECK(result.err.find(reason) != std::string::npos);
    CHECK(result.err.find("state: ") == std::string::npos);
  }
}

TEST_CASE("wrenchd rejects an invalid command line") {
  struct {
    std::vector<std::string> arguments;
    std::string reason;
  } const table[] = {
      {{"--virtual-time"}, "--seconds"},
      {{"--seconds", "0"}, "--seconds: expected a number from 0.001 to 1e+09, found '0'"},
      {{"--seconds", "nan"}, "--seconds: expected a number from"},
      {{"--seconds", "inf"}, "--seconds: expected a number from"},
      {{"--seconds", "soon"}, "--seconds: expected a number from"},
      {{"--realtime", "maybe"}, "{required,best_effort,off}"},
      {{"--config", ""}, "--config: must not be empty"},
      {{"--scene", ""}, "--scene: must not be empty"},
      {{"--record", ""}, "--record: must not be empty"},
      {{"--bogus"}, "--bogus"},
      {{"stray"}, "stray"},
      {{"--simulate", "loopback", "--profile", "loopback"}, "--profile excludes --simulate"},
  };
  for (const auto& [arguments, reason] : table) {
    const ProgramResult result = run_program("wrenchd", arguments);
    INFO(reason << "\ngot " << result.err);
    CHECK(result.exit_code > 100);
    CHECK(result.out == "");
    CHECK(result.err.find(reason) != std::string::npos);
  }
}

TEST_CASE("wrenchd records, and never overwrites a recording") {
  const TemporaryDirectory dir;
  const fs::path file = dir.path() / "run.h5";
  const ProgramResult first = run_virtual({"--arm", "--record", file.string()});
  INFO(first.err);
  CHECK(first.exit_code == 0);
  REQUIRE(fs::exists(file));
  const std::string recording = contents(file);
  CHECK(recording.size() > 100000);

  const ProgramResult second = run_virtual({"--arm", "--record", file.string()});
  CHECK(second.exit_code == 1);
  CHECK(second.err.find(file.string() +
                        ": already exists, and wrenchd never overwrites a recording; choose another name") !=
        std::string::npos);
  CHECK(contents(file) == recording);

  const fs::path text = dir.write("notes.txt", "mine");
  CHECK(run_virtual({"--record", text.string()}).exit_code == 1);
  CHECK(contents(text) == "mine");
}

TEST_CASE("a signal ends wrenchd, and the hand is released") {
  for (const int number : {SIGTERM, SIGINT}) {
    RunningProgram wrenchd("wrenchd", {"--realtime", "off", "--arm", "--live"});
    INFO(number);
    REQUIRE(wrenchd.wait_for_output("state: "));
    wrenchd.signal(number);
    const ProgramResult result = wrenchd.wait(std::chrono::seconds(20));
    INFO(result.out << result.err);
    CHECK(result.exit_code == 0);
    CHECK(result.err.find(kReleased) != std::string::npos);
    CHECK(result.out.find(" ticks in ") != std::string::npos);  // the summary
  }
}

TEST_CASE("wrenchd stops by itself after --seconds in wall time") {
  const auto start = std::chrono::steady_clock::now();
  const ProgramResult result = run_program("wrenchd", {"--realtime", "off", "--seconds", "0.5", "--live"});
  const auto took = std::chrono::steady_clock::now() - start;
  CHECK(result.exit_code == 0);
  CHECK(took > std::chrono::milliseconds(500));
  CHECK(took < std::chrono::seconds(20));
  CHECK(result.err.find(kReleased) != std::string::npos);
}

TEST_CASE("wrenchd prints help and version") {
  const ProgramResult help = run_program("wrenchd", {"--help"});
  CHECK(help.exit_code == 0);
  CHECK(help.err == "");
  for (const char* word :
       {"--config", "--scene", "--profile", "--simulate", "--realtime", "--record", "--seconds", "--arm",
        "--live", "--virtual-time", "Exit codes: 0 stopped on request; 1 rejected", "releases the hand"})
    CHECK(help.out.find(word) != std::string::npos);
  CHECK(run_program("wrenchd", {"--version"}).out.find("wrenchd ") == 0);
}

}  // namespace
}  // namespace wrenchd::test_wrenchd_program
