// SPDX-License-Identifier: GPL-3.0-or-later
#include <iterator>
#include <random>
#include <regex>
#include <utility>

#include <catch2/catch.hpp>
#include <sys/stat.h>

#include "config/load_hand_script.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_config_rejections {

namespace {

namespace fs = std::filesystem;
using test::TemporaryDirectory;
using test::with;

const fs::path kConfig = test::source_path("config");

std::string text_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

using Load = void (*)(const fs::path&);
void as_settings(const fs::path& file) {
  load_settings(file, SearchPath({kConfig}));
}
void as_scene(const fs::path& file) {
  load_scene(file);
}
void as_profile(const fs::path& file) {
  load_profile(file);
}
void as_hand_script(const fs::path& file) {
  SimulationSettings simulation;
  load_hand_script(file, simulation);
}

/// Returns the message with which the loader rejects the file; empty if the file loads.
std::string rejection_text(Load load, const fs::path& file) {
  return test::rejection_message<ConfigError>([&] { load(file); });
}

/// The text of an invalid file, the location of its error, and a part of the message.
struct Bad {
  std::string text;
  std::string place;  ///< line:column
  std::string cure;
};

void check_rejected(Load load, const std::vector<Bad>& table) {
  const TemporaryDirectory dir;
  dir.write("cube.off", "");
  for (const Bad& bad : table) {
    const fs::path file = dir.write("bad.toml", bad.text);
    test::check_rejection(rejection_text(load, file), file.string() + ":" + bad.place + ": ", bad.cure,
                          bad.text);
  }
}

const std::string kProfile = R"(name = "p"
transport = "loopback"
report_rate_Hz = 1000
watchdog_s = 0.01
[limits]
max_force_N = 10.0
max_torque_Nm = 0.5
max_linear_speed_m_per_s = 1.2
max_angular_speed_rad_per_s = 12.0
[pose_report]
id = 1
length = 36
checksum = "crc16_ccitt_false"
motors_on = { byte = 1, bit = 0 }
watchdog_tripped = { byte = 1, bit = 1 }
sequence = { byte = 2, type = "u16" }
device_time = { byte = 4, type = "u32", step_s = 1e-6 }
position = { byte = 8, type = "i32", step_m = 1e-7 }
orientation = { byte = 20, type = "i16", step = 3.06e-5 }
[wrench_report]
id = 2
length = 20
enable = { byte = 1, bit = 0 }
sequence = { byte = 2, type = "u16" }
force = { byte = 4, type = "i16", step_N = 0.001 }
torque = { byte = 10, type = "i16", step_Nm = 0.0001 }
hold_time = { byte = 16, type = "u16", step_s = 0.001 }
)";

const std::string kTool = "[tool]\nmesh = 'cube.off'\n";

const std::string kZeroRows =
    "[0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]";

std::string point(const std::string& time_s, const std::string& position_m) {
  return "[[waypoint]]\ntime_s = " + time_s + "\nposition_m = " + position_m + "\n";
}

}  // namespace

TEST_CASE("invalid settings are rejected with location and remedy", "[config]") {
  const std::vector<Bad> table = {
      {"[servo]\nrate_hz = 1000", "2:1", "key 'servo.rate_hz' is not known; did you mean 'rate_Hz'?"},
      {"[servo]\nrate_kHz = 1", "2:1", "key 'servo.rate_kHz' is not known; give it in Hz as 'rate_Hz'"},
      {"[servo]\nrate_Hz = 'fast'", "2:11", "expected a number from 500 to 8000 Hz, found the text \"fast\""},
      {"[servo]\nrate_Hz = 100", "2:11",
       "key 'servo.rate_Hz': expected a number from 500 to 8000 Hz, found 100"},
      {"[servo]\nrate_Hz = nan", "2:11", "expected a number from 500 to 8000 Hz, found nan"},
      {"[servo]\nrate_Hz = inf", "2:11", "expected a number from 500 to 8000 Hz, found inf"},
      {"[servo]\nrate_Hz = true", "2:11", "expected a number from 500 to 8000 Hz, found true"},
      {"[servo]\nrate_Hz = 1979-05-27", "2:11", "found a date or time"},
      {"[servo]\npriority = 50", "2:12", "expected a whole number from 1 to 49, found 50"},
      {"[servo]\npriority = 40.5", "2:12", "expected a whole number from 1 to 49, found 40.5"},
      {"[servo]\npriority = [40]", "2:12", "expected a whole number from 1 to 49, found an array of 1"},
      {"[servo]\nrealtime = 'yes'", "2:12",
       "expected \"required\", \"best_effort\" or \"off\", found the text \"yes\""},
      {"[servo]\npacing = 3", "2:10", "expected \"clock\" or \"device\", found 3"},
      {"[servo]\nlate_limit_ms = 20", "2:1", "give it in s as 'late_limit_s'"},
      {"[sevro]\nrate_Hz = 1000", "1:2", "key 'sevro' is not known; did you mean 'servo'?"},
      {"servo = 5", "1:9", "key 'servo': expected a table, found 5"},
      {"[[servo]]\nrate_Hz = 1000", "1:1", "key 'servo': expected a table, found an array of 1"},
      {"[device]\nscene = 'x.toml'", "2:1", "key 'device.scene' is not known; known keys here: 'profile'"},
      {"scene = 'nowhere.toml'", "1:9", "no such file; searched /"},
      {"scene = 7", "1:9", "expected a text between quotation marks, found 7"},
      {"scene = \"a\\u0000b\"", "1:9", "expected a file name without a zero byte"},
      {"\n[device]\nprofile = 'lopback'", "3:11", "profiles/lopback.toml"},
      {"[device]\nbase_in_world = { position_mm = [1, 2, 3] }", "2:19", "give it in m as 'position_m'"},
      {"[device]\nbase_in_world = { position_m = [1, 2] }", "2:32",
       "expected an array of 3 numbers, found an array of 2"},
      {"[device]\nbase_in_world = { position_m = [1, 2, 'x'] }", "2:39",
       "key 'device.base_in_world.position_m[2]': expected a number from -10 to 10 m"},
      {"[device]\ntool_in_handle = { rotation_deg = [0, 0, 0] }", "2:20",
       "known keys here: 'position_m', 'rotation_vector_rad'"},
      {"[device]\ntool_in_handle = { rotation_vector_deg = [0, 0, 90] }", "2:20",
       "give it in rad as 'rotation_vector_rad'"},
      {"[device]\ntool_in_handle = [0, 0, 0]", "2:18", "expected a table, found an array of 3"},
      {"[rendering]\nplanes = 0", "2:10", "expected a whole number from 1 to 1000, found 0"},
      {"[rendering.friction]\nstatic = 5.5", "2:10",
       "key 'rendering.friction.static': expected a number from 0 to 5, found 5.5"},
      {"[rendering.friction]\nstatic = nan", "2:10", "expected a number from 0 to 5, found nan"},
      {"[rendering.friction]\ndynamic = -0.1", "2:11", "expected a number from 0 to 5, found -0.1"},
      {"[rendering.friction]\nstatic = 0.2\ndynamic = 0.3", "3:11",
       "key 'rendering.friction.dynamic': expected no more than 'static', 0.2, found 0.3"},
      {"[rendering]\ncontacts = \"bullet\"", "2:12",
       "key 'rendering.contacts': expected \"native\" or \"cgal\", found the text \"bullet\""},
      {"[rendering]\ncontacts = true", "2:12", "expected \"native\" or \"cgal\", found true"},
      {"[rendering]\nmethod = 'planar'\ncontacts = 'cgal'", "3:12",
       "key 'rendering.contacts': only method = \"exact\" detects contacts with CGAL; choose it, or leave "
       "contacts out"},
      {"[rendering]\nsmoothing_m = 0.01", "2:15",
       "key 'rendering.smoothing_m': expected a number from 0 to 0.001"},
      {"[rendering]\nsmoothing = 0.0001", "2:1",
       "key 'rendering.smoothing' is not known; give it in m as 'smoothing_m'"},
      {"[rendering]\nmethod = 'planar'\nsmoothing_m = 0.0001", "3:15",
       "key 'rendering.smoothing_m': only method = \"exact\" uses smoothed surfaces; choose it, or leave "
       "smoothing_m out"},
      {"[rendering.friction]\nkinetic = 0.2", "2:1", "known keys here: 'static', 'dynamic'"},
      {"[rendering]\nfriction = 0.2", "2:12", "key 'rendering.friction': expected a table, found 0.2"},
      {"[rendering]\nmethod = 'planar'\n[rendering.friction]\nstatic = 0.2", "3:1",
       "key 'rendering.friction': only method = \"exact\" supports friction; choose it, or leave friction "
       "out"},
      {"[wrench]\nlaw = \"spring\"", "2:7", "expected \"pid\" or \"energy\""},
      {"[wrench]\nenergy_stiffness_per_s2 = -1", "2:27", "expected a number from 0 to 1e+09 1/s2"},
      {"[rendering]\nmethod = \"exakt\"", "2:10",
       "expected \"exact\", \"planar\", \"descent\" or \"translational\""},
      {"[wrench]\nstiffness = -5", "2:13", "expected a number from 0 to 100000, found -5"},
      {"[wrench]\nstiffness = 'high'", "2:13", "key 'wrench.stiffness': expected"},
      {"[wrench]\nstiffness = { linear_N_per_m = 600 }", "2:13",
       "key 'wrench.stiffness.angular_Nm_per_rad' is missing"},
      {"[wrench]\nstiffness = { linear_N_per_mm = 1, angular_Nm_per_rad = 1 }", "2:15",
       "give it in N/m as 'linear_N_per_m'"},
      {"[wrench]\ndamping = { linear_N_per_m = 1, angular_Nm_s_per_rad = 1 }", "2:13",
       "give it in N.s/m as 'linear_N_s_per_m'"},
      {"[wrench]\nstiffness = [[1, 0, 0, 0, 0, 0]]", "2:13",
       "expected 6 rows of 6 numbers, found an array of 1"},
      {"[wrench]\nstiffness = [" + kZeroRows + ", [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0]]", "2:114",
       "key 'wrench.stiffness[5]': expected an array of 6 numbers, found an array of 5"},
      {"[wrench]\nstiffness = [" + kZeroRows + ", [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, -3]]", "2:13",
       "its symmetric part has the eigenvalue -3; it must have none below 0"},
      {"[wrench]\nintegral_limit_mN = 1", "2:1", "give it in N as 'integral_limit_N'"},
      {"[limits]\nmax_force_kN = 1", "2:1", "give it in N as 'max_force_N'"},
      {"[limits]\nmax_force_N = 1e999", "2:20", "is not valid TOML"},
      {"[limits]\nsoft_start_s = 0", "2:16", "expected a number from 0.25 to 5 s, found 0"},
      {"[simulation]\nhandle_mass_g = 150", "2:1", "give it in kg as 'handle_mass_kg'"},
      {"[simulation]\nhandle_mass_kg = 0", "2:18", "expected a number from 0.01 to 10 kg, found 0"},
      {"[simulation]\nhand_script = 'none.toml'", "2:15", "none.toml"},
      {"[control]\nsocket = \"here.sock\"", "2:10",
       "key 'control.socket': expected an absolute path, or \"none\", found \"here.sock\"; clients and"},
      {"[control]\nsocket = 5", "2:10", "expected a text between quotation marks, found 5"},
      {"[control]\noperators = \"*\"", "2:13", "only observers may be everybody; name a group"},
      {"[control]\nadministrators = \"*\"", "2:18", "only observers may be everybody; name a group"},
      {"[control]\noperator = \"wrench\"", "2:1", "did you mean 'operators'?"},
      {"[recording]\nfile = false", "2:8", "expected a text between quotation marks, found false"},
      {"[recording]\ndirectory = \"here\"", "2:13", "expected an absolute path, found \"here\""},
      {"[recording]\nflight_s = -1", "2:12", "expected a number from 0 to 120 s, found -1"},
      {"[recording]\nflight_s = \"60\"", "2:12", "expected a number"},
      {"[recording]\nflights_kept = 0", "2:16", "expected a whole number from 1 to 1000, found 0"},
      {"[recording]\nkeep_free_MB = -5", "2:16", "expected a number from 0 to 10000000, found -5"},
      {"[recording]\nflight = 60", "2:1", "flight_s"},
      {"[simulation]\nplayback = 'none.csv'", "2:12", "none.csv"},
      {"[simulation]\nplayback_mode = \"exact\"", "2:17", "\"open\""},
      {"[recording]\n\"\\u0001\\n\" = 1", "2:1", "key 'recording.?\?' is not known"},
      {"[servo]\nrate_Hz = 1000\nrate_Hz = 2000", "3:11", "a key may appear once only, keep one of them"},
      {"[servo]\nrate_Hz = 1000\n[servo]\ncpu = 1", "3:1", "a key may appear once only, keep one of them"},
      {"[servo]\nrate_Hz =", "2:10", "is not valid TOML"},
      {"[servo\nrate_Hz = 1000", "1:7", "is not valid TOML"},
      {"scene = \"no end\n", "1:16", "is not valid TOML"},
      {"scene = \"\xff\xfe\"", "1:9", "save the file as UTF-8"},
      {std::string("scene = \0", 9), "1:9", "is not valid TOML"},
      {"\xff\xfes\0c\0e\0n\0e\0", "1:1", "save the file as UTF-8"},
      {"a = " + std::string(10'000, '['), "1:261", "nested"},
      {"a = " + std::string(20, '[') + std::string(20, ']'), "1:21",
       "is nested more than 16 deep; flatten it"},
      {"\na" +
           [] {
             std::string s;
             for (int i = 0; i < 500'000; ++i) s += ".a";
             return s;
           }() +
           " = 1",
       "2:1", "has more than 120 dots in one line"},
  };
  check_rejected(as_settings, table);
}

TEST_CASE("invalid scenes are rejected with location and remedy", "[config]") {
  const std::string plane = kTool + "[[obstacle]]\nhalf_space = ";
  const std::string mesh = kTool + "[[obstacle]]\nmesh = 'cube.off'\n";
  const std::vector<Bad> table = {
      {"", "1:1", "key 'tool' is missing; it has no default, so state it here"},
      {"\n[tool]\nscale = 1.0", "2:1", "key 'tool.mesh' is missing; state it, or 'meshes', here"},
      {"[tool]\nmesh = 'missing.off'", "2:8", "no such file; searched /"},
      {"[tool]\nmesh = '.'", "2:8", "name an OFF, OBJ, STL or PLY file"},
      {"[tool]\nmesh = { make = 'geer' }", "2:17",
       "key 'tool.mesh.make': no generated mesh of kind 'geer'; did you mean 'gear'?"},
      {"[tool]\nmesh = { make = 'teapot' }", "2:17",
       "no generated mesh of kind 'teapot'; there are cube, plate, table,"},
      {"[tool]\nmesh = { make = 3 }", "2:17", "key 'tool.mesh.make': expected a text"},
      {"[tool]\nmesh = { triangles = 300 }", "2:8", "key 'tool.mesh.make' is missing"},
      {"[tool]\nmesh = { make = 'gear', triangels = 300 }", "2:25", "did you mean 'triangles'?"},
      {"[tool]\nmesh = { make = 'gear', triangles = 3 }", "2:37",
       "key 'tool.mesh.triangles': expected a whole number from 8 to 20000000, found 3"},
      {"[tool]\nmesh = { make = 'gear', seed = 3 }", "2:32", "only bumpy and boulder are random"},
      {"[tool]\nmesh = { make = 'gear', size_m = [1, 1, 1] }", "2:34",
       "only a box has sides that can be chosen; use 'scale', beside 'mesh'"},
      {"[tool]\nmesh = { make = 'box', size_m = [1, 1, 0] }", "2:40",
       "key 'tool.mesh.size_m[2]': expected a number from 1e-06 to 100 m, found 0"},
      {kTool + "[[obstacle]]\nmesh = { make = 'nutt' }", "4:17", "did you mean 'nut'?"},
      {"[tool]\nmash = 'cube.off'", "2:1", "key 'tool.mash' is not known; did you mean 'mesh'?"},
      {kTool + "scale = 0", "3:9", "key 'tool.scale': expected a number from 1e-09 to 1000000 m, found 0"},
      {kTool + "scale = -1.0", "3:9", "found -1"},
      {kTool + "mass = 0.0", "3:8", "kg, found 0"},
      {kTool + "mass_g = 200", "3:1", "give it in kg as 'mass'"},
      {"mass = 1\n" + kTool + "mass = 1", "4:8", "is also given at the top of the file; keep one of the two"},
      {plane + "{ normal = [0, 0, 0], offset = 0 }", "4:25", "must not be zero; it points out of the solid"},
      {plane + "{ normal = [0, nan, 1], offset = 0 }", "4:29", "key 'obstacle[0].half_space.normal[1]'"},
      {plane + "{ normal = [0, 1], offset = 0 }", "4:25",
       "expected an array of 3 numbers, found an array of 2"},
      {plane + "{ normal = 'up', offset = 0 }", "4:25",
       "expected an array of 3 numbers, found the text \"up\""},
      {plane + "{ normal = [0, 0, 1] }", "4:14", "key 'obstacle[0].half_space.offset' is missing"},
      {plane + "{ normal = [0, 0, 1], offset = -inf }", "4:45", "found -inf"},
      {plane + "{ normal = [0, 0, 1], offset_mm = 3 }", "4:36", "give it in m as 'offset'"},
      {plane + "[0, 0, 1, 0]", "4:14", "expected a table, found an array of 4"},
      {kTool + "[[obstacle]]\nmesh = 'none.off'", "4:8", "no such file; searched /"},
      {kTool + "[[obstacle]]\nmesh = 'cube.off'\nhalf_space = { normal = [0, 0, 1], offset = 0 }", "5:14",
       "the obstacle has a mesh already; give each shape an [[obstacle]] of its own"},
      {kTool + "[[obstacle]]\nscale = 2.0\nhalf_space = { normal = [0, 0, 1], offset = 0 }", "4:9",
       "belongs to a mesh; a half_space is defined by normal and offset"},
      {kTool + "[[obstacle]]\nmesh = 'cube.off'\nposition_m = [0, 0]", "5:14", "3 numbers"},
      {mesh + "velocity_m_per_s = [0, 1]", "5:20",
       "key 'obstacle[0].velocity_m_per_s': expected an array of 3 numbers, found an array of 2"},
      {mesh + "velocity_m_per_s = 1.0", "5:20", "expected an array of 3 numbers, found 1"},
      {mesh + "velocity_m_per_s = [0, nan, 0]", "5:24",
       "key 'obstacle[0].velocity_m_per_s[1]': expected a number from -5 to 5 m/s, found nan"},
      {mesh + "velocity_m_per_s = [0, 0, -5.1]", "5:27", "expected a number from -5 to 5 m/s, found -5.1"},
      {mesh + "velocity_m_per_s = [4, 0, 4]", "5:20", "m/s; give one of no more than 5 m/s"},
      {mesh + "velocity_mm_per_s = [0, 0, 20]", "5:1", "give it in m/s as 'velocity_m_per_s'"},
      {mesh + "angular_velocity_rad_per_s = [inf, 0, 0]", "5:31",
       "expected a number from -50 to 50 rad/s, found inf"},
      {mesh + "angular_velocity_rad_per_s = [0, 40, -40]", "5:30",
       "rad/s; give one of no more than 50 rad/s"},
      {mesh + "angular_velocity_rad_per_s = [0, 0]", "5:30", "3 numbers"},
      {mesh + "angular_velocity_deg_per_s = [0, 0, 90]", "5:1",
       "give it in rad/s as 'angular_velocity_rad_per_s'"},
      {mesh + "reverse_after_s = 2.0", "5:19",
       "the obstacle does not move; give it velocity_m_per_s or angular_velocity_rad_per_s"},
      {mesh + "velocity_m_per_s = [0, 0, 0]\nreverse_after_s = 2.0", "6:19", "the obstacle does not move"},
      {mesh + "velocity_m_per_s = [0, 0, 1]\nreverse_after_s = -1", "6:19",
       "expected a number from 0 to 86400 s, found -1"},
      {mesh + "velocity_m_per_s = [0, 0, 1]\nreverse_after_s = inf", "6:19", "s, found inf"},
      {mesh + "velocity_m_per_s = [0, 0, 1]\nreverse_after_ms = 500", "6:1",
       "give it in s as 'reverse_after_s'"},
      {plane + "{ normal = [0, 0, 1], offset = 0 }\nvelocity_m_per_s = [0, 0, 1]", "5:20",
       "belongs to a mesh; a half_space cannot move; use a mesh for a moving obstacle"},
      {plane + "{ normal = [0, 0, 1], offset = 0 }\nangular_velocity_rad_per_s = [0, 0, 1]", "5:30",
       "a half_space cannot move"},
      {plane + "{ normal = [0, 0, 1], offset = 0 }\nreverse_after_s = 1", "5:19", "a half_space cannot move"},
      {kTool + "[[obstacle]]\nsphere = 1.0", "4:1",
       "key 'obstacle[0].sphere' is not known; known keys here: 'name', 'mesh', 'meshes', 'half_space'"},
      {kTool + "[[obstacle]]\nname = 'x'", "3:1",
       "key 'obstacle[0].half_space' is missing; state it, or 'mesh', here"},
      {kTool + "[[obstacle]]\nmehs = 'cube.off'", "4:1", "did you mean 'mesh'?"},
      {kTool + "[obstacle]\nname = 'x'", "3:1", "expected tables, each headed [[obstacle]], found a table"},
      {kTool + "[[obstacles]]\nname = 'x'", "3:3", "did you mean 'obstacle'?"},
  };
  check_rejected(as_scene, table);
}

TEST_CASE("a rejected velocity is not also reported for its reversal", "[config]") {
  const TemporaryDirectory dir;
  dir.write("cube.off", "");
  const auto file = dir.write("s.toml", kTool +
                                            "[[obstacle]]\nmesh = 'cube.off'\nvelocity_m_per_s = [9, 0, 0]\n"
                                            "reverse_after_s = 1");
  const std::string message = rejection_text(as_scene, file);
  CHECK(message.find("velocity_m_per_s[0]") != std::string::npos);
  CHECK(message.find('\n') == std::string::npos);
}

TEST_CASE("invalid profiles are rejected with location and remedy", "[config]") {
  const auto changed = [](const std::string& from, const std::string& to) {
    return with(kProfile, from, to);
  };
  const std::string position = R"(position = { byte = 8, type = "i32", step_m = 1e-7 })";
  const std::vector<Bad> table = {
      {"", "1:1", "key 'limits' is missing; it has no default"},
      {changed("max_force_N = 10.0\n", ""), "5:1", "key 'limits.max_force_N' is missing; it has no default"},
      {changed("max_torque_Nm = 0.5\n", ""), "5:1", "key 'limits.max_torque_Nm' is missing"},
      {changed("max_force_N = 10.0", "max_force_mN = 10000"), "6:1", "give it in N as 'max_force_N'"},
      {changed("max_force_N = 10.0", "max_force_N = 0"), "6:15", "from 0.01 to 200 N, found 0"},
      {changed("max_torque_Nm = 0.5", "max_torque_Nmm = 500"), "7:1", "give it in N.m as 'max_torque_Nm'"},
      {changed("\"loopback\"", "\"bluetooth\""), "2:13",
       "expected \"loopback\", \"hidraw\" or \"libusb\", found the text \"bluetooth\""},
      {changed("name = \"p\"", "name = \"\""), "1:8", "1 to 64 letters"},
      {changed("watchdog_s = 0.01", "watchdog_ms = 10"), "4:1", "give it in s as 'watchdog_s'"},
      {changed("watchdog_s = 0.01", "watchdog_s = 0"), "4:14", "from 0.001 to 2 s, found 0"},
      {changed("id = 1\n", "id = 256\n"), "11:6", "expected a whole number from 0 to 255, found 256"},
      {changed("length = 36", "length = 29"), "19:15",
       "key 'pose_report.orientation': its last byte is 27, but fields end with byte 26"},
      {changed("length = 36", "length = 65"), "12:10", "from 2 to 64, found 65"},
      {changed("\"crc16_ccitt_false\"", "\"crc32\""), "13:12",
       "expected \"crc16_ccitt_false\", \"sum8\", \"xor8\" or \"none\""},
      {changed(position, R"(position = { byte = 7, type = "i32", step_m = 1e-7 })"), "18:12",
       "key 'pose_report.position': overlaps 'pose_report.device_time', which has bytes 4 to 7; move one of "
       "them"},
      {changed("watchdog_tripped = { byte = 1, bit = 1 }", "watchdog_tripped = { byte = 1, bit = 0 }"),
       "15:20", "overlaps 'pose_report.motors_on'"},
      {changed(position, R"(position = { byte = 8, type = "u32", step_m = 1e-7 })"), "18:31",
       R"(expected "i8", "i16" or "i32", found the text "u32")"},
      {changed(position, R"(position = { byte = 8, type = "i32", step_mm = 1e-4 })"), "18:38",
       "give it in m as 'step_m'"},
      {changed(position, R"(position = { byte = 8, type = "i32", step_m = -1e-7 })"), "18:47",
       "found -1e-07"},
      {changed(position, R"(position = { byte = 0, type = "i32", step_m = 1e-7 })"), "18:21",
       "from 1 to 63, found 0"},
      {changed(position, ""), "10:1", "key 'pose_report.position' is missing"},
      {changed("step = 3.06e-5", "step = 3e-5"), "19:49", "less than the 0.999 it has to carry"},
      {changed("step_N = 0.001", "step_N = 0.0001"), "25:44",
       "16 bits with this step reach 3.2767 N, less than the 10 N it has to carry; use a larger step or a "
       "wider type"},
      {changed("hold_time = { byte = 16, type = \"u16\", step_s = 0.001 }", "hold_time = 16"), "27:13",
       "expected a table, found 16"},
      {changed("enable = { byte = 1, bit = 0 }", "enable = { byte = 1, bit = 8 }"), "23:28",
       "from 0 to 7, found 8"},
  };
  check_rejected(as_profile, table);
}

TEST_CASE("invalid hand scripts are rejected with location and remedy", "[config]") {
  const std::string start = point("0", "[0, 0, 0]");
  const std::vector<Bad> table = {
      {"", "1:1", "key 'waypoint' is missing"},
      {"waypoint = []", "1:12", "at least one waypoint is needed"},
      {"waypoint = 3", "1:12", "expected tables, each headed [[waypoint]], found 3"},
      {"waypoint = [3]", "1:13", "key 'waypoint[0]': expected a table, found 3"},
      {point("1", "[0, 0, 0]"), "2:10", "the first waypoint is at time 0"},
      {start + point("1", "[0, 0, 1]") + point("1", "[0, 0, 0]"), "8:10",
       "times must ascend by 0.001 s or more; the waypoint before is at 1 s"},
      {start + point("1", "[0, 0, 1]"), "4:1",
       "ends where it starts; add such a waypoint, or set repeats = false"},
      {start + point("-1", "[0, 0, 0]"), "5:10", "from 0 to 86400 s, found -1"},
      {"repeats = 'no'\n" + start, "1:11", "expected true or false, found the text \"no\""},
      {start + "rotation_vector_deg = [0, 0, 90]", "4:1", "give it in rad as 'rotation_vector_rad'"},
      {point("0", "[0, 0, 40]"), "3:21", "from -10 to 10 m, found 40"},
  };
  check_rejected(as_hand_script, table);
}

TEST_CASE("all defects of a file are reported together, in file order", "[config]") {
  const TemporaryDirectory dir;
  const auto file = dir.write("w.toml", "[servo]\nrate_Hz = 1\nprioriti = 3\n[limits]\nsoft_start_s = 9\n");
  try {
    as_settings(file);
    FAIL("it loaded");
  } catch (const ConfigError& error) {
    REQUIRE(error.rejections().size() == 3);
    CHECK(error.rejections()[0].location.line == 2);
    CHECK(error.rejections()[1].location.line == 3);
    CHECK(error.rejections()[2].location.line == 5);
  }
}

TEST_CASE("a misspelt mandatory key is reported once", "[config]") {
  const TemporaryDirectory dir;
  const auto file = dir.write("p.toml", with(kProfile, "max_force_N = 10.0", "max_force_mN = 10000"));
  const std::string message = rejection_text(as_profile, file);
  CHECK(message.find('\n') == std::string::npos);
}

TEST_CASE("unreadable files and files that are too large are rejected", "[config]") {
  const TemporaryDirectory dir;
  const fs::path absent = dir.path() / "absent.toml";
  CHECK(rejection_text(as_scene, absent) == absent.string() + ": no such file; searched " + absent.string());
  CHECK(test::rejects_at(rejection_text(as_scene, dir.path()), dir.path().string() + ": ",
                         "is a directory; name a file in it"));
  const fs::path pipe = dir.path() / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK(test::rejects_at(rejection_text(as_scene, pipe), pipe.string() + ": ",
                         "is a FIFO; name a regular file"));
  CHECK(rejection_text(as_scene, "/dev/zero").find("is a character device; name a regular file") !=
        std::string::npos);
  const fs::path big = dir.write("big.toml", std::string((1 << 20) + 1, '#'));
  CHECK(test::rejects_at(rejection_text(as_scene, big), big.string() + ": ", "is larger than 1 MiB"));
  CHECK(rejection_text(as_scene, std::string(5000, 'a')).find("cannot be opened") != std::string::npos);
}

TEST_CASE("a rejected hand script changes nothing", "[config]") {
  const TemporaryDirectory dir;
  SimulationSettings s;
  CHECK_THROWS_AS(load_hand_script(dir.write("h.toml", point("0", "[0, 0, 0]") + "x = 1"), s), ConfigError);
  CHECK(s.hand_path.empty());
  CHECK(s.hand_script == SimulationSettings{}.hand_script);
}

TEST_CASE("deep nesting through many lines of dotted keys does not overflow the stack", "[config]") {
  std::string text = "x = ";
  std::string dotted = "a";
  for (int i = 0; i < 119; ++i) dotted += ".a";
  for (int i = 0; i < 120; ++i) text += "[\n{" + dotted + " = ";
  text += "1";
  for (int i = 0; i < 120; ++i) text += "}\n]";
  const TemporaryDirectory dir;
  CHECK(test::rejects_at(rejection_text(as_scene, dir.write("deep.toml", text)),
                         "deep.toml:", "is nested more than 16 deep"));
}

TEST_CASE("mutated files load or are rejected", "[config]") {
  const std::vector<std::pair<Load, std::string>> sources = {
      {as_settings, text_of(kConfig / "wrenchd.toml")},
      {as_scene, text_of(kConfig / "scenes/cube_on_table.toml")},
      {as_profile, text_of(kConfig / "profiles/example.toml")},
      {as_hand_script, text_of(kConfig / "hands/press_and_rock.toml")}};
  constexpr int kMutants = 20'000;
  const TemporaryDirectory dir;
  std::mt19937 random(20240607);
  const auto below = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  int rejected = 0;
  for (int i = 0; i < kMutants; ++i) {
    const auto& [load, source] = sources[static_cast<std::size_t>(i) % sources.size()];
    std::string text = source;
    for (std::size_t n = 1 + below(4); n > 0; --n) text[below(text.size())] = static_cast<char>(below(256));
    if (below(4) == 0) text.resize(1 + below(text.size()));
    if (below(4) == 0) text.insert(below(text.size()), text.substr(below(text.size()), below(200)));
    rejected += rejection_text(load, dir.write("mutant.toml", text)).empty() ? 0 : 1;
  }
  CHECK(rejected > kMutants / 4);
}

TEST_CASE("a configuration in place of a scene, or the reverse, is named as what it is", "[config]") {
  using Catch::Matchers::Contains;
  CHECK_THAT(rejection_text(as_scene, kConfig / "gallery/staircase.toml"),
             Contains("'view' is not known; this is a configuration") && Contains("its key 'scene'"));
  CHECK_THAT(rejection_text(as_settings, kConfig / "scenes/staircase.toml"),
             Contains("'obstacle' is not known; this is a scene") && Contains("--scene"));
  const TemporaryDirectory dir;
  const std::string manual = text_of(kConfig / "wrenchd.toml");
  const std::regex section("\n\\[(\\w+)\\]\n");
  int sections = 0;
  for (std::sregex_iterator i(manual.begin(), manual.end(), section), end; i != end; ++i, ++sections)
    CHECK_THAT(rejection_text(as_scene, dir.write("section.toml", "[" + (*i)[1].str() + "]\n")),
               Contains("this is a configuration"));
  CHECK(sections >= 9);
}

}  // namespace wrenchd::test_config_rejections
