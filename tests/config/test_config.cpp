// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <iterator>
#include <locale>
#include <sstream>

#include <catch2/catch.hpp>

#include "config/load_hand_script.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_config {

namespace {

namespace fs = std::filesystem;
using test::TemporaryDirectory;

const fs::path kConfig = test::source_path("config");
const SearchPath kShipped({kConfig});

std::string text_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void print(std::ostream& out, const PoseSettings& X) {
  out << X.position_m.transpose() << '\n' << X.rotation_vector_rad.transpose() << '\n';
}

void print(std::ostream& out, const SimulationSettings& s) {
  for (const double x :
       {s.handle_mass_kg, s.handle_inertia_kg_m2, s.viscous_friction_N_s_per_m,
        s.viscous_friction_Nm_s_per_rad, s.coulomb_friction_N, s.coulomb_friction_Nm, s.position_quantum_m,
        s.rotation_quantum_rad, s.actuator_max_force_N, s.actuator_max_torque_Nm, s.report_delay_s,
        s.command_delay_s, s.hand_stiffness_N_per_m, s.hand_stiffness_Nm_per_rad, s.hand_damping_N_s_per_m,
        s.hand_damping_Nm_s_per_rad}) {
    out << x << '\n';
  }
  out << s.playback << int(s.playback_mode) << s.playback_path.size() << '\n';
  out << s.hand_repeats << s.hand_script << s.hand_path.size() << '\n';
}

/// Returns all settings as text, so that a comparison shows the difference.
std::string printed(const Settings& s) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(17);
  out << s.scene << s.device.profile << s.device.profile_file << s.device.serial << '\n';
  print(out, s.device.base_in_world);
  print(out, s.device.tool_in_handle);
  out << s.servo.rate_Hz << ' ' << int(s.servo.pacing) << int(s.servo.realtime) << ' ' << s.servo.priority
      << ' ' << s.servo.cpu << ' ' << s.servo.late_limit_s << '\n'
      << int(s.rendering.method) << ' ' << s.rendering.planes << ' ' << int(s.rendering.contacts) << ' '
      << s.rendering.smoothing_m << ' ' << s.rendering.friction.static_coefficient << ' '
      << s.rendering.friction.dynamic_coefficient << '\n'
      << s.rendering.grasp.force_N << ' ' << s.rendering.grasp.torque_Nm << '\n'
      << static_cast<int>(s.wrench.law) << ' ' << s.wrench.energy_stiffness_per_s2 << '\n'
      << s.wrench.gains.stiffness << '\n'
      << s.wrench.gains.integral << '\n'
      << s.wrench.gains.damping << '\n'
      << s.wrench.gains.integral_limit_N << ' ' << s.wrench.gains.integral_limit_Nm << ' '
      << s.wrench.gains.derivative_cutoff_Hz << '\n'
      << s.limits.max_force_N << ' ' << s.limits.max_torque_Nm << ' ' << s.limits.force_slew_N_per_s << ' '
      << s.limits.torque_slew_Nm_per_s << ' ' << s.limits.soft_start_s << '\n';
  print(out, s.simulation);
  out << s.recording.file << s.recording.directory << s.recording.flight_s << ' ' << s.recording.flights_kept
      << ' ' << s.recording.keep_free_MB << '\n'
      << s.control.socket << '\n'
      << s.control.observers << '\n'
      << s.control.operators << '\n'
      << s.control.administrators << '\n'
      << s.description << '\n'
      << s.view.eye_m.transpose() << '\n'
      << s.view.target_m.transpose();
  return out.str();
}

/// Returns the defaults of the structs, with the paths of the shipped files.
Settings defaults() {
  Settings settings;
  settings.scene = kConfig / settings.scene;
  settings.device.profile_file = kConfig / profile_file(settings.device.profile);
  load_hand_script(kConfig / settings.simulation.hand_script, settings.simulation);
  return settings;
}

Settings settings_from(std::string_view text) {
  const TemporaryDirectory dir;
  return load_settings(dir.write("wrenchd.toml", text), kShipped);
}

SceneSettings scene_from(std::string_view text) {
  const TemporaryDirectory dir;
  dir.write("cube.off", "");
  return load_scene(dir.write("scene.toml", text));
}

std::vector<fs::path> shipped(const std::string& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(kConfig / folder)) files.push_back(entry.path());
  return files;
}

/// A locale with a decimal comma.
struct Comma : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

}  // namespace

TEST_CASE("the shipped wrenchd.toml contains the defaults", "[config]") {
  CHECK(printed(load_settings(kConfig / "wrenchd.toml", kShipped)) == printed(defaults()));
}

TEST_CASE("an empty wrenchd.toml has the default values", "[config]") {
  CHECK(printed(settings_from("")) == printed(defaults()));
}

TEST_CASE("deleting any option of wrenchd.toml changes nothing", "[config]") {
  const std::string text = text_of(kConfig / "wrenchd.toml");
  const std::string expected = printed(defaults());
  int options = 0;
  for (std::size_t start = 0, end; start < text.size(); start = end + 1) {
    end = text.find('\n', start);
    const std::string line = text.substr(start, end - start);
    if (line.empty() || line[0] == '#' || line[0] == '[') continue;
    INFO(line);
    CHECK(printed(settings_from(text.substr(0, start) + text.substr(end))) == expected);
    ++options;
  }
  CHECK(options == 66);
}

TEST_CASE("every shipped file is valid", "[config]") {
  for (const auto& file : shipped("profiles")) {
    INFO(file);
    CHECK(load_profile(file).name == file.stem());
  }
  for (const auto& file : shipped("scenes")) CHECK_NOTHROW(load_scene(file));
  for (const auto& file : shipped("gallery")) CHECK_NOTHROW(load_settings(file, kShipped));
  for (const auto& file : shipped("hands")) {
    SimulationSettings simulation;
    CHECK_NOTHROW(load_hand_script(file, simulation));
  }
}

TEST_CASE("the shipped scene is a cube over a table", "[config]") {
  const SceneSettings scene = load_scene(kConfig / "scenes/cube_on_table.toml");
  CHECK(scene.tool.scale == 0.001);
  CHECK(scene.tool.mass_kg == 0.2);
  CHECK(fs::equivalent(scene.tool.mesh, kConfig / "meshes/cube.off"));
  REQUIRE(scene.half_spaces.size() == 1);
  CHECK(scene.half_spaces[0].name == "table");
  CHECK(scene.half_spaces[0].normal_W == Vector3d::UnitZ());
}

TEST_CASE("the shipped plunger moves periodically, within reach of the shipped hand", "[config]") {
  const SceneSettings scene = load_scene(kConfig / "scenes/cube_over_plunger.toml");
  REQUIRE(scene.half_spaces.size() == 1);
  REQUIRE(scene.meshes.size() == 1);
  const MeshObstacleSettings& plunger = scene.meshes[0];
  const double half_m = 0.025;
  const auto top_m = [&](double t_s) {
    return plunger.motion.pose_at(plunger.X_WM, t_s).translation_m.z() + half_m;
  };
  const double back_s = plunger.motion.reverse_after_s;
  CHECK(top_m(0.0) == Approx(-0.010));
  CHECK(top_m(back_s) == Approx(0.012));
  CHECK(top_m(2.0 * back_s) == Approx(-0.010));
  SimulationSettings s;
  load_hand_script(kConfig / "hands/press_and_rock.toml", s);
  CHECK(s.hand_path.front().position_m.z() - half_m > top_m(back_s));  // it starts without contact
  double lowest_m = 1.0;
  for (const Waypoint& w : s.hand_path) lowest_m = std::min(lowest_m, w.position_m.z() - half_m);
  CHECK(lowest_m < top_m(back_s));
}

TEST_CASE("a mesh may have a velocity; without one it is at rest", "[config]") {
  const auto motion = [](const std::string& keys) {
    const SceneSettings scene =
        scene_from("[tool]\nmesh = 'cube.off'\n[[obstacle]]\nmesh = 'cube.off'\n" + keys);
    REQUIRE(scene.meshes.size() == 1);
    return scene.meshes[0].motion;
  };
  CHECK_FALSE(motion("").moves());
  CHECK_FALSE(motion("velocity_m_per_s = [0, 0, 0]").moves());
  const ObstacleMotion all = motion(
      "velocity_m_per_s = [3, 0, -4]\nangular_velocity_rad_per_s = [0, 50, 0.0]\nreverse_after_s = 1.5");
  CHECK(all.moves());
  CHECK(all.linear_m_per_s == Vector3d(3, 0, -4));
  CHECK(all.angular_rad_per_s == Vector3d(0, 50, 0));
  CHECK(all.reverse_after_s == 1.5);
  const ObstacleMotion turning = motion("kind = 'surface'\nangular_velocity_rad_per_s = [1, 0, 0]");
  CHECK(turning.moves());
  CHECK(turning.linear_m_per_s == Vector3d::Zero());
  CHECK(turning.reverse_after_s == 0.0);
}

TEST_CASE("a mesh may be generated instead of read", "[config]") {
  const SceneSettings scene = scene_from(
      "[tool]\nmesh = { make = 'gear', triangles = 5000 }\nscale = 2\n"
      "[[obstacle]]\nmesh = { make = 'boulder', seed = 7 }\nkind = 'surface'\n"
      "[[obstacle]]\nmesh = { make = 'box', size_m = [0.1, 0.2, 0.3] }\n"
      "[[obstacle]]\nmesh = 'cube.off'\n");
  REQUIRE(scene.tool.generated.has_value());
  CHECK(scene.tool.generated->kind == "gear");
  CHECK(scene.tool.generated->triangles == 5000);
  CHECK(scene.tool.mesh == "made gear, 5000 triangles");
  CHECK(scene.tool.scale == 2.0);
  REQUIRE(scene.meshes.size() == 3);
  CHECK(scene.meshes[0].generated.value().seed == 7);
  CHECK(scene.meshes[0].mesh == "made boulder, 20000 triangles, seed 7");
  CHECK(scene.meshes[0].kind == BodyKind::surface);
  CHECK(scene.meshes[1].generated.value().size_m == Vector3d(0.1, 0.2, 0.3));
  CHECK_FALSE(scene.meshes[2].generated.has_value());
}

TEST_CASE("the shipped hand moves no faster than 0.3 m/s", "[config]") {
  SimulationSettings s;
  load_hand_script(kConfig / "hands/press_and_rock.toml", s);
  CHECK(s.hand_repeats);
  constexpr double kPeakOverMean = 1.875;  // ratio of peak to mean speed of a minimum-jerk motion
  for (std::size_t i = 1; i < s.hand_path.size(); ++i) {
    const Waypoint& a = s.hand_path[i - 1];
    const Waypoint& b = s.hand_path[i];
    const double mean_m_per_s = (b.position_m - a.position_m).norm() / (b.time_s - a.time_s);
    CHECK(kPeakOverMean * mean_m_per_s < 0.3);
  }
}

TEST_CASE("a gain is a number, two blocks, or a matrix", "[config]") {
  CHECK(settings_from("[wrench]\nlaw = 'pid'").wrench.law == SpringLaw::pid);
  CHECK(settings_from("[wrench]\nenergy_stiffness_per_s2 = 12").wrench.energy_stiffness_per_s2 == 12.0);
  CHECK(settings_from("[wrench]\nstiffness = 5").wrench.gains.stiffness == 5.0 * Matrix6d::Identity());
  CHECK(settings_from("[wrench]\nstiffness = { linear_N_per_m = 2, angular_Nm_per_rad = 3.5 }")
            .wrench.gains.stiffness == WrenchGains::blockwise(2.0, 3.5));
  const Matrix6d K = settings_from(
                         "[wrench]\ndamping = [[2, 1, 0, 0, 0, 0], [-1, 2, 0, 0, 0, 0],"
                         "[0, 0, 3, 0, 0, 0], [0, 0, 0, 4, 0, 0.5], [0, 0, 0, 0, 5, 0],"
                         "[0, 0, 0, 0.5, 0, 6]]")
                         .wrench.gains.damping;
  CHECK(K(0, 1) == 1.0);
  CHECK(K(1, 0) == -1.0);
  CHECK(K(5, 3) == 0.5);
  CHECK(K(5, 5) == 6.0);
}

TEST_CASE("one friction coefficient sets both", "[config]") {
  const auto read = [](const std::string& text) {
    return settings_from("[rendering.friction]\n" + text).rendering.friction;
  };
  CHECK(read("static = 0.5\ndynamic = 0.25").static_coefficient == 0.5);
  CHECK(read("static = 0.5\ndynamic = 0.25").dynamic_coefficient == 0.25);
  CHECK(read("static = 0.5").dynamic_coefficient == 0.5);
  CHECK(read("dynamic = 0.25").static_coefficient == 0.25);
  CHECK(read("static = 0.5\ndynamic = 0").dynamic_coefficient == 0.0);
}

TEST_CASE("a placement may give position or rotation only", "[config]") {
  const DeviceSettings device = settings_from(
                                    "[device]\ntool_in_handle = { position_m = [1, 2.5, -3] }\n"
                                    "base_in_world.rotation_vector_rad = [0, 0, 1.5]")
                                    .device;
  CHECK(device.tool_in_handle.position_m == Vector3d(1.0, 2.5, -3.0));
  CHECK(device.tool_in_handle.rotation_vector_rad == Vector3d::Zero());
  CHECK(device.base_in_world.rotation_vector_rad == Vector3d(0.0, 0.0, 1.5));
}

TEST_CASE("integers and real numbers are interchangeable if the conversion is exact", "[config]") {
  CHECK(settings_from("[servo]\nrate_Hz = 2000").servo.rate_Hz == 2000.0);
  CHECK(settings_from("[servo]\npriority = 40.0").servo.priority == 40);
  CHECK_THROWS_AS(settings_from("[servo]\npriority = 40.5"), ConfigError);
}

TEST_CASE("loading does not depend on the locale", "[config]") {
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Comma));
  const std::string loaded = printed(load_settings(kConfig / "wrenchd.toml", kShipped));
  std::string message;
  try {
    settings_from("[limits]\nsoft_start_s = 1234.5");
  } catch (const ConfigError& error) {
    message = error.what();
  }
  std::locale::global(before);
  CHECK(loaded == printed(defaults()));
  CHECK(message.find("expected a number from 0.25 to 5 s, found 1234.5") != std::string::npos);
}

TEST_CASE("files named in wrenchd.toml are searched beside it first", "[config]") {
  const TemporaryDirectory dir;
  dir.write("my_scene.toml", "");
  dir.write("scenes/cube_on_table.toml", "");
  const auto file = dir.write("wrenchd.toml", "scene = 'my_scene.toml'");
  CHECK(load_settings(file, kShipped).scene == dir.path() / "my_scene.toml");
  dir.write("wrenchd.toml", "");
  CHECK(load_settings(file, kShipped).scene == dir.path() / "scenes/cube_on_table.toml");
}

TEST_CASE("a scene without obstacles is free space", "[config]") {
  const SceneSettings scene = scene_from("[tool]\nmesh = 'cube.off'");
  CHECK(scene.half_spaces.empty());
  CHECK(scene.tool.scale == 1.0);
  CHECK(scene.tool.mass_kg == 1.0);
}

TEST_CASE("the mass may be in [tool] or at the top", "[config]") {
  CHECK(scene_from("mass = 3\n[tool]\nmesh = 'cube.off'").tool.mass_kg == 3.0);
  CHECK(scene_from("[tool]\nmesh = 'cube.off'\nmass = 4.0").tool.mass_kg == 4.0);
}

TEST_CASE("a normal of any length describes the same solid", "[config]") {
  const SceneSettings scene = scene_from(
      "[tool]\nmesh = 'cube.off'\n"
      "[[obstacle]]\nhalf_space = { normal = [0, 3, 4], offset = 10 }\n"
      "[[obstacle]]\nhalf_space = { normal = [1e-3, 0, 0], offset = -0.001 }");
  REQUIRE(scene.half_spaces.size() == 2);
  CHECK(scene.half_spaces[0].normal_W.isApprox(Vector3d(0.0, 0.6, 0.8), 1e-15));
  CHECK(scene.half_spaces[0].offset_m == Approx(2.0).epsilon(1e-15));
  CHECK(scene.half_spaces[1].normal_W == Vector3d::UnitX());
  CHECK(scene.half_spaces[1].offset_m == -1.0);
  CHECK(scene.half_spaces[1].name == "obstacle[1]");
}

TEST_CASE("all fields of a profile are read", "[config]") {
  const DeviceProfile p = load_profile(kConfig / "profiles/example.toml");
  CHECK(p.max_force_N == 6.0);
  CHECK(p.wrench_point == WrenchPoint::handle);
  CHECK(p.pose_report.checksum == Checksum::crc16_ccitt_false);
  CHECK(p.pose_report.motors_on.present);
  const ReportField& position = p.pose_report.position;
  CHECK((position.present && position.is_signed));
  CHECK(position.byte == 7);
  CHECK(position.bits == 16);
  CHECK(position.count == 3);
  CHECK(position.step == 1e-5);
  CHECK(p.pose_report.orientation.count == 4);
  CHECK_FALSE(p.wrench_report.sequence.is_signed);
  CHECK(p.wrench_report.enable.bit == 7);
}

TEST_CASE("fields that a profile omits are absent", "[config]") {
  const TemporaryDirectory dir;
  std::string text = text_of(kConfig / "profiles/example.toml");
  for (const std::string key :
       {"linear_velocity", "buttons", "acknowledged", "stale_fault_s", "wrench_point"}) {
    text.insert(text.find("\n" + key) + 1, "# ");
  }
  const DeviceProfile p = load_profile(dir.write("p.toml", text));
  CHECK_FALSE(p.pose_report.linear_velocity.present);
  CHECK_FALSE(p.pose_report.buttons.present);
  CHECK(p.pose_report.angular_velocity.present);
  CHECK(p.stale_fault_s == DeviceProfile{}.stale_fault_s);
}

TEST_CASE("a hand script with one waypoint keeps the hand at rest", "[config]") {
  const TemporaryDirectory dir;
  SimulationSettings s;
  load_hand_script(dir.write("h.toml", "[[waypoint]]\ntime_s = 0\nposition_m = [0, 0, 0.1]"), s);
  CHECK(s.hand_repeats);
  REQUIRE(s.hand_path.size() == 1);
  CHECK(s.hand_path[0].position_m == Vector3d(0.0, 0.0, 0.1));
}

}  // namespace wrenchd::test_config
