// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <wrenchd/client.hpp>

#include "daemon/recording/recording_file.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_record_methods {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

/// wrenchd with a simulated hand in contact, and its own paths for socket and recordings.
struct Daemon {
  TemporaryDirectory files;
  std::string socket = (files.path() / "control.sock").string();
  std::filesystem::path recordings = files.path() / "recordings";
  RunningProgram wrenchd;

  explicit Daemon(std::vector<std::string> more = {}, const std::string& settings = {})
      : wrenchd("wrenchd", words(std::move(more), settings)) {}
  /// Returns true when the hand presses.
  bool presses() const { return wrenchd.wait_for_output("state: active"); }
  std::vector<std::string> words(std::vector<std::string> more, const std::string& settings) {
    const auto config =
        files.write("config/wrenchd.toml", "[servo]\nself_test_s = 0\n[recording]\ndirectory = \"" +
                                               recordings.string() + "\"\n" + settings);
    for (const std::string& word :
         {std::string("--config"), config.string(), std::string("--control"), socket,
          std::string("--realtime"), std::string("best_effort"), std::string("--arm")})
      more.push_back(word);
    return more;
  }
  ProgramResult ctl(std::vector<std::string> words) const {
    words.insert(words.end(), {"--socket", socket});
    return run_program("wrenchctl", words);
  }
};

bool is_gapless(const Recording& recording) {
  for (std::size_t i = 1; i < recording.ticks.size(); ++i)
    if (recording.ticks[i].tick > recording.ticks[i - 1].tick + 1) return false;
  return true;
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Runs /usr/bin/python3, which has Debian's h5py. Appends its output to out and returns the exit code.
int run_python(const std::string& arguments, std::string& out) {
  FILE* const pipe = popen(("/usr/bin/python3 -W error " + arguments + " 2>&1").c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::array<char, 4096> bytes;
  for (std::size_t got; (got = fread(bytes.data(), 1, bytes.size(), pipe)) > 0;)
    out.append(bytes.data(), got);
  const int status = pclose(pipe);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

TEST_CASE("wrenchctl starts and stops a recording, which opens in plain Python",
          "[recording][program][wall_time]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.presses());
  CHECK(daemon.ctl({"record", "stop"}).err.find("No recording runs; 'record.start' starts one.") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "mark", "too early"})
            .err.find("No recording runs, so nothing would contain the marker") != std::string::npos);
  const ProgramResult started = daemon.ctl({"record", "start", "mine"});
  INFO(started.err);
  REQUIRE(started.exit_code == 0);
  const auto file = daemon.recordings / "mine.h5";
  CHECK(started.out == "recording " + file.string() + "\n");
  CHECK(daemon.ctl({"record", "start"}).err.find("A recording is already running: " + file.string()) !=
        std::string::npos);
  CHECK(daemon.ctl({"status"}).out.find("recording  " + file.string()) != std::string::npos);
  std::this_thread::sleep_for(2s);
  CHECK(daemon.ctl({"record", "mark", "trial 3", "--set", "stiffness=2000", "--set", "surface=rubber"}).out ==
        "marked trial 3 in " + file.string() + "\n");
  CHECK(daemon.ctl({"record", "mark", "x", "--set", "2x=1"}).err.find("letters, digits and underscores") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "mark", "x", "--set", "stiffness"}).err.find("expected NAME=VALUE") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "mark"}).err.find("a label is missing") != std::string::npos);
  Client(daemon.socket).mark("trial 4", {{"stiffness", 1500.5}, {"surface", std::string("wood")}});
  std::this_thread::sleep_for(2s);
  const ProgramResult ended = daemon.ctl({"record", "stop"});
  CHECK(ended.out.starts_with("recorded " + file.string()));
  REQUIRE_RATE(load, ended.out.ends_with(" ticks, 0 missing\n"));
  REQUIRE_RATE(load, read_recording(file).ticks.size() > 3500);
  CHECK(is_gapless(read_recording(file)));
  const Recording recording = read_recording(file);
  std::vector<RecordedEvent> markers;
  std::copy_if(recording.events.begin(), recording.events.end(), std::back_inserter(markers),
               [](const RecordedEvent& event) { return event.name == "marker"; });
  REQUIRE(markers.size() == 2);
  CHECK(markers[0].text == "trial 3");
  CHECK(markers[0].conditions == R"({"stiffness":2000.0,"surface":"rubber"})");
  CHECK(markers[1].conditions == R"({"stiffness":1500.5,"surface":"wood"})");
  for (const RecordedEvent& marker : markers) {
    const auto tick = std::find_if(recording.ticks.begin(), recording.ticks.end(), [&](const auto& t) {
      return static_cast<std::int64_t>(t.tick) == marker.tick;
    });
    REQUIRE(tick != recording.ticks.end());
    CHECK(tick->now_ns <= marker.time_ns);
    CHECK((tick + 1)->now_ns > marker.time_ns);
  }
  std::string printed;
  CHECK(run_python(test::source_path("tests/python/check_recording.py") + " " + file.string(), printed) == 0);
  INFO(printed);
  CHECK(printed.find(" ticks, ") != std::string::npos);

  // The daemon passes a recording to a client that cannot read the daemon's files.
  CHECK(daemon.ctl({"record", "list"}).out.starts_with("mine.h5 "));
  const auto copy = daemon.files.path() / "copy.h5";
  CHECK(daemon.ctl({"record", "get", "mine", "-o", copy.string()}).out == copy.string() + "\n");
  CHECK(bytes_of(copy) == bytes_of(file));
  CHECK(bytes_of(copy).size() > 10'000);
  const auto script = daemon.files.write("rows.py", R"(import sys
sys.path.insert(0, sys.argv[1])
import h5py, wrenchd
with wrenchd.Client(sys.argv[2]) as client, client.open_recording("mine.h5") as file, h5py.File(file) as recording:
    print(len(recording["ticks"]))
)");
  std::string rows;
  CHECK(run_python(script.string() + " " + test::source_path("tools/python") + " " + daemon.socket, rows) ==
        0);
  CHECK(rows == std::to_string(read_recording(file).ticks.size()) + "\n");
  CHECK(daemon.ctl({"record", "get", "yours"}).err.find("there are: mine.h5") != std::string::npos);
  CHECK(daemon.ctl({"record", "get", "../mine"}).err.find("is not a valid name of a recording") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "get"}).err.find("record list") != std::string::npos);
  CHECK(daemon.ctl({"record", "list", "-o", "x"}).err.find("accepts no -o") != std::string::npos);
  CHECK(daemon.ctl({"record", "start", "next"}).exit_code == 0);
  CHECK(daemon.ctl({"record", "list"}).out.find("next") == std::string::npos);
  CHECK(daemon.ctl({"record", "get", "next"}).err.find("is incomplete") != std::string::npos);
  CHECK(daemon.ctl({"record", "stop"}).exit_code == 0);
  CHECK(daemon.ctl({"record", "list"}).out.find("\nnext.h5 ") != std::string::npos);

  // An administrator may give a path, relative to the directory of wrenchctl.
  const auto elsewhere = daemon.files.path() / "elsewhere.h5";
  CHECK(daemon.ctl({"record", "start", elsewhere.string()}).exit_code == 0);
  CHECK(daemon.ctl({"record", "stop"}).exit_code == 0);
  CHECK(std::filesystem::exists(elsewhere));
  CHECK(daemon.ctl({"record", "start", "no/such/directory/x.h5"}).err.find("cannot be created") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "start", "a b"}).err.find("is not a valid name of a recording") !=
        std::string::npos);
  CHECK(daemon.ctl({"record", "stop", "x"}).err.find("accepts no file") != std::string::npos);
}

TEST_CASE("an emergency stop leaves a flight recording, which status and the event name",
          "[recording][flight][program]") {
  const MachineLoad load;
  const Daemon daemon;
  REQUIRE_RATE(load, daemon.presses());
  CHECK(daemon.ctl({"stop"}).exit_code == 0);
  REQUIRE(daemon.wrenchd.wait_for_output("flight recorder: the ticks before stop_requested are in "));
  const std::string err = daemon.wrenchd.err();
  CHECK(err.find("; recorded in " + (daemon.recordings / "flight-").string()) != std::string::npos);
  const ProgramResult status = daemon.ctl({"status", "--json"});
  const auto last = nlohmann::json::parse(status.out)["recording"]["last_flight"].get<std::string>();
  CHECK(last.starts_with((daemon.recordings / "flight-").string()));
  CHECK(last.ends_with("-stop_requested.h5"));
  CHECK(daemon.ctl({"status"}).out.find("last fault " + last) != std::string::npos);
  const Recording recording = read_recording(last);
  CHECK(recording.ticks.front().tick == 0);  // the run is shorter than the flight recorder's minute
  CHECK(is_gapless(recording));
}

TEST_CASE("a recording of a killed daemon can be read, except for its last 2 s",
          "[recording][program][wall_time]") {
  RandomValues random(7);
  for (int i = 0; i < 4; ++i) {
    const MachineLoad load;
    Daemon daemon({}, "flight_s = 0\n");
    REQUIRE_RATE(load, daemon.presses());
    const auto file = daemon.recordings / "mine.h5";
    REQUIRE(daemon.ctl({"record", "start", "mine"}).exit_code == 0);
    const auto begun = std::chrono::steady_clock::now();
    std::this_thread::sleep_for(2500ms + std::chrono::milliseconds(random.bits() % 700));
    daemon.wrenchd.signal(SIGKILL);
    const double ran_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    daemon.wrenchd.wait();
    const Recording recording = read_recording(file);
    REQUIRE_RATE(load, recording.ticks.size() > 500);
    const double has_s =
        1e-9 * static_cast<double>(recording.ticks.back().now_ns - recording.ticks.front().now_ns);
    INFO("ran " << ran_s << " s, has " << has_s);
    REQUIRE_RATE(load, has_s > ran_s - 2.0);
    CHECK(is_gapless(recording));
    CHECK(recording.contacts.size() > 100);
  }
}

TEST_CASE("wrenchctl replays, exports and plots a recording of wrenchd", "[recording][program]") {
  const TemporaryDirectory files;
  const std::string file = (files.path() / "run.h5").string();
  const ProgramResult run =
      run_program("wrenchd", {"--config", test::source_path("config/wrenchd.toml"), "--virtual-time",
                              "--seconds", "6", "--arm", "--record", file});
  INFO(run.err);
  REQUIRE(run.exit_code == 0);
  CHECK(run.err.find("recorded: " + file + ", 6001 ticks") != std::string::npos);
  const ProgramResult replayed = run_program("wrenchctl", {"replay", file});
  INFO(replayed.out << replayed.err);
  CHECK(replayed.exit_code == 0);
  CHECK(replayed.out.find("compared: X_WP, X_WQ, X_WB, eps, F_T, F_external, F_out, energy, ") !=
        std::string::npos);
  CHECK(replayed.out.find("6001 ticks, all bits are equal") != std::string::npos);
  const ProgramResult other = run_program(
      "wrenchctl", {"replay", file, "--scene", test::source_path("config/scenes/cube_over_plunger.toml")});
  CHECK(other.exit_code == 4);
  CHECK(other.out.find("first difference at tick ") != std::string::npos);

  const ProgramResult csv =
      run_program("wrenchctl", {"export", file, "--columns", "state,F_out", "--every", "1000"});
  CHECK(csv.exit_code == 0);
  CHECK(csv.out.starts_with("time_s [s],state [enum],F_out.fx [N]"));
  CHECK(std::count(csv.out.begin(), csv.out.end(), '\n') == 8);
  const ProgramResult wrong = run_program("wrenchctl", {"export", file, "--columns", "force"});
  CHECK(wrong.exit_code == 1);
  CHECK(wrong.err.find("the recording has no column 'force'") != std::string::npos);
  const ProgramResult plot = run_program("wrenchctl", {"plot", file});
  INFO(plot.err);
  CHECK(plot.exit_code == 0);
  CHECK(std::filesystem::exists(files.path() / "run/force.svg"));
  const ProgramResult none = run_program("wrenchctl", {"plot", (files.path() / "none.h5").string()});
  CHECK(none.exit_code == 1);
  CHECK(none.err.find("none.h5: does not exist") != std::string::npos);
}

}  // namespace wrenchd::test_record_methods
