// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <fstream>
#include <map>

#include <catch2/catch.hpp>

#include "config/config_error.hpp"
#include "config/load_scene.hpp"
#include "daemon/control/reconfigurator.hpp"
#include "tests/support/invariants.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_reconfigurator {

// The rendering changes while the hand is in contact.

namespace {

using namespace test;

const std::string kMeshes = test::source_path("config/meshes/");

/// Returns a scene with a cube of 50 mm as tool, and these obstacles.
std::string scene_text(const std::string& obstacles) {
  return "[tool]\nmesh = \"" + kMeshes + "cube.off\"\nscale = 0.001\nmass = 0.2\n" + obstacles;
}
const std::string kTable =
    "[[obstacle]]\nname = \"table\"\nhalf_space = { normal = [0.0, 0.0, 1.0], offset = 0.0 }\n";
std::string block(const std::string& name, const std::string& position) {
  return "[[obstacle]]\nname = \"" + name + "\"\nmesh = \"" + kMeshes +
         "cube.off\"\nscale = 0.001\nposition_m = " + position + "\n";
}

/// Returns the shipped configuration with a hand that presses the cube 8 mm into its table and stays there.
RunConfig pressing_plan() {
  RunConfig plan = shipped_config();
  plan.settings.wrench.law = SpringLaw::pid;
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()},
                                        {0.3, {0, 0, 0.065}, Vector3d::Zero()},
                                        {0.8, {0, 0, 0.017}, Vector3d::Zero()},
                                        {1.0, {0, 0, 0.017}, Vector3d::Zero()}};
  plan.settings.simulation.hand_repeats = false;
  return plan;
}

/// A runtime in virtual time. Every tick is checked against the invariants.
struct Rig : VirtualRuntime {
  TemporaryDirectory files;
  Invariants invariants;
  double max_step_N = 0.0;               ///< Largest change of the force between two ticks.
  double max_second_difference_N = 0.0;  ///< Largest second difference of the force.
  double max_generated_J = 0.0;          ///< Largest energy generated.
  int inactive_ticks = 0;                ///< Ticks in which the state was not active.

  explicit Rig(RunConfig plan = pressing_plan())
      : VirtualRuntime(std::move(plan)),
        invariants({runtime.config().profile.max_force_N, runtime.config().profile.max_torque_Nm,
                    runtime.config().settings.limits.force_slew_N_per_s,
                    runtime.config().settings.limits.torque_slew_Nm_per_s, 1e-3, 20e-3}) {}

  Reconfigurator& reconfigurator() { return runtime.reconfigurator(); }

  void go() { REQUIRE(go_on() == Fault::none); }
  Fault go_on() {
    const Vector3d before = force(), before_that = earlier_;
    const Fault fault = tick();
    const auto broken = invariants.check(last);
    REQUIRE(broken.value_or("") == "");
    max_step_N = std::max(max_step_N, (force() - before).norm());
    max_second_difference_N =
        std::max(max_second_difference_N, (force() - 2.0 * before + before_that).norm());
    max_generated_J = std::max(max_generated_J, last.injected_J);
    inactive_ticks += state() == State::active ? 0 : 1;
    earlier_ = before;
    return fault;
  }
  void go_for(double duration_s) {
    for (int i = 0; i < static_cast<int>(1000.0 * duration_s); ++i) go();
  }
  /// Arms, and presses the cube on the table until it is at rest.
  void press() {
    runtime.loop().requests().arm();
    go_for(3.0);
    REQUIRE(state() == State::active);
    REQUIRE(last.contacts == 4);
    reset_extrema();
  }
  void reset_extrema() { max_step_N = max_second_difference_N = max_generated_J = 0.0, inactive_ticks = 0; }
  Vector3d force() const { return {last.F_out[0], last.F_out[1], last.F_out[2]}; }
  std::filesystem::path file(const std::string& name, const std::string& text) {
    return files.write(name, text);
  }
  /// Returns true if the last tick used the submitted rendering, unchanged.
  bool rendering_intact() { return last.rendering_checksum == reconfigurator().current_rendering().checksum; }

 private:
  Vector3d earlier_ = Vector3d::Zero();
};

TomlNode toml(const std::string& text) {
  return read_toml_text(text, "request");
}

TEST_CASE("another scene with the same table under the hand does not change the force", "[reconfigurator]") {
  Rig s;
  s.press();
  const double before_N = s.force().z();
  s.reconfigurator().replace_scene(
      s.file("other.toml", scene_text(kTable + block("post", "[0.2, 0.0, 0.0]"))));
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.rendering_intact());
  CHECK(s.inactive_ticks == 0);
  CHECK(s.max_step_N < 0.02);
  CHECK(s.force().z() == Approx(before_N).epsilon(0.01));
}

TEST_CASE("a removed wall fades its force out, and an inserted wall fades its force in", "[reconfigurator]") {
  Rig s;
  s.press();
  REQUIRE(s.force().z() > 1.0);
  s.reconfigurator().remove_obstacle("table");
  s.go_for(1.5);
  CHECK(s.force().norm() < 1e-9);
  CHECK(s.inactive_ticks == 0);
  const double pace_N = 1e-3 * std::max(s.runtime.config().profile.max_force_N, 20.0);
  CHECK(s.max_step_N < 2.0 * pace_N);
  CHECK(s.max_second_difference_N < 2.0 * pace_N);
  // The table returns 8 mm above the hand. The proxy is put on top of the table, and the hand is pushed up.
  s.reset_extrema();
  CHECK(s.reconfigurator().insert_obstacle(
            toml("name = \"table\"\nhalf_space = { normal = [0, 0, 1], offset = 0 }"), "request") == "table");
  s.go_for(2.0);
  CHECK(s.last.contacts == 4);
  CHECK(s.force().z() > 1.0);
  CHECK(s.inactive_ticks == 0);
  CHECK(s.max_step_N < 2.0 * pace_N);
  CHECK(s.max_generated_J < 2e-3);
  CHECK((s.last.limit_causes & kPassivity) == 0);
}

TEST_CASE("an added obstacle may have a generated mesh", "[reconfigurator]") {
  Rig s;
  s.press();
  const char* wall =
      "name = \"wall\"\nmesh = { make = \"box\", size_m = [0.02, 0.2, 0.2] }\n"
      "position_m = [0.034, 0.0, 0.0]";
  CHECK(s.reconfigurator().insert_obstacle(toml(wall), "request") == "wall");
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.last.X_WQ[0] < -0.0009);  // the face of the wall is at 24 mm, the face of the cube at 25 mm
  CHECK(s.reconfigurator().present_scene()->settings.meshes.back().mesh ==
        "made box 0.02 x 0.2 x 0.2 m, 20000 triangles");
  const char* unknown = "name = \"pot\"\nmesh = { make = \"teapot\" }";
  CHECK_THROWS_WITH(s.reconfigurator().insert_obstacle(toml(unknown), "request"),
                    Catch::Contains("no generated mesh of kind 'teapot'"));
}

TEST_CASE("a change of stiffness in contact causes no jump", "[reconfigurator]") {
  Rig s;
  s.press();
  s.reconfigurator().set_rendering(
      toml("[wrench]\nstiffness = { linear_N_per_m = 400.0, angular_Nm_per_rad = 1.0 }"), "request");
  s.go_for(1.5);
  const double depth_m = 0.025 - s.last.X_WP[2];
  CHECK(s.force().z() == Approx(400.0 * depth_m).epsilon(0.02));
  CHECK(s.max_step_N < 0.02);
  CHECK(s.inactive_ticks == 0);
  CHECK(s.rendering_intact());
}

TEST_CASE("the method, the law and friction can be changed in contact", "[reconfigurator]") {
  const std::string changes =
      GENERATE(as<std::string>{}, "[rendering]\nmethod = \"translational\"", "[wrench]\nlaw = \"energy\"",
               "[rendering.friction]\nstatic = 0.5", "[wrench]\nlaw = \"pid\"");
  Rig s;
  s.press();
  s.reconfigurator().set_rendering(toml(changes), "request");
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.rendering_intact());
  CHECK(s.force().z() > 1.0);
  CHECK(s.max_step_N < 0.05);
  CHECK(s.inactive_ticks == 0);
}

TEST_CASE("the contact detection can be changed in contact", "[reconfigurator][cgal_contacts]") {
  Rig s;
  s.press();
  CHECK(s.reconfigurator().contacts() == ContactBackend::native);
  s.reconfigurator().set_rendering(toml("[rendering]\ncontacts = \"cgal\""), "request");
  CHECK(s.reconfigurator().contacts() == ContactBackend::cgal);
  s.go_for(1.0);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.force().z() > 1.0);
  CHECK(s.inactive_ticks == 0);
}

TEST_CASE("surfaces can be smoothed in contact, and keep their facets again", "[reconfigurator]") {
  Rig s;
  s.reconfigurator().insert_obstacle(
      toml("name = \"ball\"\nmesh = { make = \"sphere\", triangles = 500 }\nposition_m = [0.3, 0.0, 0.0]"),
      "request");
  s.press();
  const auto triangles = [&] {
    return s.reconfigurator().scene_view().scene->meshes().back().mesh->surface.triangles().size();
  };
  const std::size_t facets = triangles();
  s.reconfigurator().set_rendering(toml("[rendering]\nsmoothing_m = 0.001"), "request");
  s.go_for(1.0);
  CHECK(triangles() > 20 * facets);
  CHECK(s.reconfigurator().settings().rendering.smoothing_m == 0.001);
  CHECK(s.force().z() > 1.0);
  CHECK(s.max_step_N < 0.05);
  s.reconfigurator().set_rendering(toml("[rendering]\nsmoothing_m = 0.0"), "request");
  s.go_for(1.0);
  CHECK(triangles() == facets);
  CHECK(s.rendering_intact());
  CHECK(s.inactive_ticks == 0);
}

TEST_CASE("a rejected change has no effect, and its message has the location and the remedy",
          "[reconfigurator]") {
  Rig s;
  s.press();
  const std::uint32_t changes = s.last.change_count;
  const auto handed_over = s.reconfigurator().current_rendering();
  const auto message_of = [](auto&& act) -> std::string {
    try {
      act();
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  };
  const auto rejected_load =
      message_of([&] { s.reconfigurator().replace_scene(s.file("bad.toml", scene_text("[[obstacle]]\n"))); });
  CHECK(rejected_load.find("bad.toml:5:") != std::string::npos);
  CHECK(message_of([&] {
          s.reconfigurator().replace_scene(s.file("bad2.toml", "[tool]\nmesh = \"" +
                                                                   s.file("open.off",
                                                                          "OFF\n3 1 0\n0 0 0\n1 0 "
                                                                          "0\n0 1 0\n3 0 1 2\n")
                                                                       .string() +
                                                                   "\"\n"));
        }).find("open.off") != std::string::npos);
  CHECK(message_of([&] { s.reconfigurator().remove_obstacle("tabel"); }) ==
        "there is no obstacle 'tabel' in the scene; there are: table");
  CHECK(message_of([&] { s.reconfigurator().move_obstacle("table", Pose{}, 1.0); }).find("half_space") !=
        std::string::npos);
  CHECK(message_of([&] {
          s.reconfigurator().insert_obstacle(
              toml("name = \"table\"\nhalf_space = { normal = [0, 0, 1], offset = 0 }"), "request");
        }).find("there is an obstacle 'table' already") != std::string::npos);
  CHECK(message_of([&] {
          s.reconfigurator().set_rendering(toml("[wrench]\nstiffness = -1.0"), "request");
        }).find("request:2:") != std::string::npos);
  CHECK(message_of([&] {
          s.reconfigurator().set_rendering(toml("[rendering]\nmethod = \"planar\"\nfriction.static = 0.3"),
                                           "request");
        }).find("exact") != std::string::npos);
  CHECK(message_of([&] { s.reconfigurator().set_scale(0.0); }).find("scale: expected 0.1 to 10") !=
        std::string::npos);
  s.go_for(0.3);
  CHECK(s.last.change_count == changes);
  CHECK(s.last.rendering_id == 0);
  CHECK(s.reconfigurator().current_rendering().id == handed_over.id);
  CHECK(s.max_step_N < 0.02);
}

TEST_CASE("a moved block starts at its position, moves for duration_s, and pushes the tool",
          "[reconfigurator][moving]") {
  Rig s;
  s.press();
  // The block starts beside the cube, on its left, and moves through the position of the cube.
  s.reconfigurator().replace_scene(
      s.file("block.toml", scene_text(kTable + block("block", "[0.0, 0.1, 0.02]"))));
  s.go_for(1.2);
  REQUIRE(s.last.rendering_id == 1);
  s.reconfigurator().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.03, 0.02}}, 2.0);
  s.reset_extrema();
  double most_push_m = 0.0;
  bool jumped = false;
  for (int i = 0; i < 3000; ++i) {
    s.go();
    jumped = jumped || s.last.X_WQ[1] > 1e-3;
    most_push_m = std::max(most_push_m, -s.last.X_WQ[1]);
  }
  CHECK_FALSE(jumped);
  CHECK(most_push_m > 0.01);  // the final pose of the block overlaps the cube by 20 mm; the hand yields
  CHECK(s.last.passivity_scale == 1.0);
  CHECK(s.inactive_ticks == 0);
  // The block moves back, and starts where its first motion ended.
  s.reconfigurator().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.1, 0.02}}, 1.0);
  s.go_for(0.1);
  CHECK_THROWS_AS(s.reconfigurator().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.2, 0.02}}, 1.0),
                  BusyError);
  s.go_for(2.0);
  CHECK(std::abs(s.last.X_WQ[1]) < 0.002);
  CHECK_THROWS_WITH(
      s.reconfigurator().move_obstacle("block", {Quaterniond::Identity(), {9.0, 0.1, 0.02}}, 1.0),
      Catch::Contains("give it at least duration_s = 1.8"));
}

TEST_CASE("after a plate appears inside the tool, the proxy is on the side where it was",
          "[reconfigurator]") {
  Rig s;
  s.press();
  // The plate intersects the tool at the hand's pose, and is just below the proxy.
  s.reconfigurator().replace_scene(
      s.file("plate.toml", scene_text("[[obstacle]]\nname = \"plate\"\nmesh = \"" + kMeshes +
                                      "cube.off\"\nscale = 0.001\nposition_m = [0.0, 0.0, -0.0251]\n")));
  s.go_for(2.0);
  CHECK(s.last.X_WQ[2] > 0.0249);
  CHECK(s.force().z() > 1.0);
  CHECK(s.inactive_ticks == 0);
  CHECK(s.max_step_N < 0.02);
}

TEST_CASE("if the tool does not fit into the new scene, the force fades to zero and stays zero",
          "[reconfigurator]") {
  Rig s;
  s.press();
  std::string box;
  for (const char* n : {"[1, 0, 0]", "[-1, 0, 0]", "[0, 1, 0]", "[0, -1, 0]", "[0, 0, 1]", "[0, 0, -1]"})
    box += std::string("[[obstacle]]\nhalf_space = { normal = ") + n + ", offset = 0.02 }\n";
  s.reconfigurator().replace_scene(s.file("box.toml", scene_text(box)));
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(static_cast<ProxyInitialization>(s.last.proxy_initialization) == ProxyInitialization::failed);
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == State::waiting);
  CHECK(s.max_step_N < 0.1);
}

TEST_CASE("with the clutch engaged the hand moves without force, and then continues from the tool's pose",
          "[reconfigurator][workspace]") {
  RunConfig plan = pressing_plan();
  auto& path = plan.settings.simulation.hand_path;
  path.push_back({3.5, {0, 0, 0.017}, Vector3d::Zero()});
  path.push_back({4.5, {0.03, 0, 0.057}, {0.0, 0.0, 0.4}});  // 40 mm up
  path.push_back({5.5, {0.03, 0, 0.057}, {0.0, 0.0, 0.4}});
  path.push_back({6.0, {0.03, 0, 0.049}, {0.0, 0.0, 0.4}});  // 8 mm down
  Rig s(plan);
  s.press();
  s.reconfigurator().set_clutched(true);
  s.go_for(0.3);
  CHECK(s.force_N() == 0.0);
  CHECK(s.max_step_N < 0.2);
  const auto X_WP = s.last.X_WP;
  s.go_for(2.0);
  CHECK(s.last.X_WP == X_WP);
  s.reconfigurator().set_clutched(false);
  s.reset_extrema();
  s.go_for(0.2);
  CHECK(s.last.X_WP[2] == Approx(0.025).margin(1e-3));  // on the table, without force
  CHECK(s.max_step_N < 0.1);
  s.go_for(1.5);
  CHECK(s.force().z() > 1.0);
  CHECK(s.inactive_ticks == 0);
}

TEST_CASE("the scale of the workspace changes without moving the tool, and the wrench keeps its power",
          "[reconfigurator][workspace]") {
  Rig s;
  s.press();
  const double z_m = s.last.X_WP[2];
  s.reconfigurator().set_scale(2.0);
  s.go_for(0.5);
  CHECK(s.max_step_N < 0.1);
  CHECK(s.inactive_ticks == 0);
  CHECK(std::abs(s.last.X_WP[2] - z_m) < 3e-3);
  const double depth_m = 0.025 - s.last.X_WP[2];
  CHECK(s.force().z() == Approx(2.0 * 600.0 * depth_m).epsilon(0.03));
  s.reconfigurator().recentre();
  s.go_for(0.06);
  CHECK(s.force_N() == 0.0);
  s.go_for(0.2);
  CHECK(s.last.X_WP[2] == Approx(2.0 * s.last.X_BH[2]).margin(1e-9));
}

TEST_CASE("a scale that applies at once with recentring gets the same stability bound as a gradual one",
          "[reconfigurator][workspace]") {
  const auto scale_of = [](bool recentred) {
    RunConfig plan = pressing_plan();
    plan.settings.servo.self_test_s = 0.5;  // measures the stability bound of the device
    for (std::size_t i = 1; i < plan.settings.simulation.hand_path.size(); ++i)
      plan.settings.simulation.hand_path[i].time_s += 0.6;
    Rig s(plan);
    s.go_for(0.6);
    s.press();
    if (recentred) s.reconfigurator().set_clutched(true);
    s.reconfigurator().set_scale(8.0);
    if (recentred) {
      s.reconfigurator().recentre();
      s.reconfigurator().set_clutched(false);
    }
    s.go_for(0.5);
    return s.last.stiffness_scale;
  };
  const double gradually = scale_of(false);
  CHECK(gradually < 0.9);
  CHECK(scale_of(true) == gradually);
}

TEST_CASE("a local model pushes, and fades out at the end of its lifetime", "[reconfigurator][models]") {
  RunConfig plan = pressing_plan();
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()}};
  Rig s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.0);
  REQUIRE(s.state() == State::active);
  s.reset_extrema();
  LocalModel wall;
  wall.id = 1;
  wall.kind = LocalModel::Kind::plane;
  wall.normal_W = {0, 0, 2.0};
  wall.offset_m = 2.0 * 0.067;
  wall.stiffness_N_per_m = 500.0;
  s.reconfigurator().set_model(wall, 0.3);
  s.go_for(0.25);
  CHECK(s.force().z() == Approx(500.0 * (0.067 - s.last.X_BH[2])).epsilon(0.05));
  CHECK(s.force().z() > 0.2);
  s.reconfigurator().set_model(wall, 0.3);  // sent again before the end of its lifetime
  s.go_for(0.2);
  CHECK(s.force().z() > 0.2);
  s.go_for(0.12);
  CHECK(s.force_N() == 0.0);
  CHECK(s.max_step_N < 0.05);
  CHECK(s.inactive_ticks == 0);
  CHECK(s.max_generated_J < 1e-3);
  wall.stiffness_N_per_m = -1.0;
  CHECK_THROWS_WITH(s.reconfigurator().set_model(wall, 0.3),
                    Catch::Contains("stiffness_N_per_m: expected 0 to"));
  wall.stiffness_N_per_m = 1.0;
  CHECK_THROWS_WITH(s.reconfigurator().set_model(wall, 60.0), Catch::Contains("send it again"));
}

TEST_CASE("a local model stiffer than the stability bound is scaled down", "[reconfigurator][models]") {
  RunConfig plan = pressing_plan();
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()}};
  Rig s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.0);
  LocalModel spring;
  spring.kind = LocalModel::Kind::spring;
  spring.X_WA = {Quaterniond::Identity(), {0, 0, 0.066}};
  spring.stiffness_N_per_m = 20000.0;
  s.reconfigurator().set_model(spring, 5.0);
  s.go_for(1.0);
  CHECK(s.state() == State::active);
  CHECK(s.force().z() < 0.7 * 20000.0 * (0.066 - s.last.X_BH[2]));
  CHECK(s.max_generated_J < 2e-3);
}

/// A copy of the configuration in files that the test changes.
struct Configured {
  TemporaryDirectory files;
  std::filesystem::path config, scene;

  Configured() {
    write_scene(kTable);
    write("");
  }
  /// Writes the configuration. The law is that of Eq. (16), unless the text names one.
  void write(std::string more) {
    const std::string table = "[wrench]\n", law = "law = \"pid\"\n";
    if (more.find(table) == std::string::npos) more += table;
    if (more.find("law = ") == std::string::npos) more.insert(more.find(table) + table.size(), law);
    config = files.write("wrenchd.toml", "scene = \"scene.toml\"\n" + more);
  }
  void write_scene(const std::string& obstacles) { scene = files.write("scene.toml", scene_text(obstacles)); }
  RunConfig read() const {
    RunConfig plan = load_run_config({config, {}, {}, false}, SearchPath({test::source_path("config")}));
    const RunConfig pressing = pressing_plan();
    plan.settings.servo.self_test_s = 0.0;
    plan.settings.simulation = pressing.settings.simulation;
    return plan;
  }
};

TEST_CASE("with two hands scene and rendering do not change, workspace and local models do",
          "[reconfigurator]") {
  RunConfig plan = pressing_plan();
  plan.second_hand = "left";
  Rig rig(plan);
  Reconfigurator& reconfigurator = rig.reconfigurator();
  const auto rejected = [](const auto& change) {
    try {
      change();
    } catch (const std::invalid_argument& error) {
      return std::string(error.what()).find("change the file and start wrenchd again") != std::string::npos;
    }
    return false;
  };
  const auto file = rig.files.write("scene.toml", scene_text(kTable));
  CHECK(rejected([&] { reconfigurator.replace_scene(file); }));
  CHECK(rejected([&] { reconfigurator.insert_obstacle(TomlNode{{}, TomlNode::Table{}}, "x"); }));
  CHECK(rejected([&] { reconfigurator.remove_obstacle("table"); }));
  CHECK(rejected([&] { reconfigurator.move_obstacle("table", Pose{}, 1.0); }));
  CHECK(rejected([&] { reconfigurator.set_rendering(TomlNode{{}, TomlNode::Table{}}, "x"); }));
  CHECK(rejected([&] { reconfigurator.reload([] { return shipped_config(); }); }));
  CHECK_NOTHROW(reconfigurator.set_scale(1.5));
  CHECK_NOTHROW(reconfigurator.recentre());
  CHECK_NOTHROW(reconfigurator.set_model({}, 1.0));
  CHECK(reconfigurator.current_rendering().id == 0);
}

TEST_CASE("a reload applies all changes except those that require a restart", "[reconfigurator][reload]") {
  Configured c;
  Rig s(c.read());
  s.press();
  const auto read = [&c] { return c.read(); };
  CHECK(s.reconfigurator().reload(read).applied.empty());
  c.write(
      "[servo]\nrate_Hz = 2000.0\n[wrench]\nstiffness = { linear_N_per_m = 300.0, angular_Nm_per_rad = 1.0 "
      "}\n[limits]\nmax_force_N = 2.0\nforce_slew_N_per_s = 5000.0\n");
  const ReloadResult result = s.reconfigurator().reload(read);
  CHECK(result.applied == std::vector<std::string>{"wrench.stiffness", "limits.max_force_N"});
  REQUIRE(result.not_applied.size() == 2);
  CHECK(result.not_applied[0] == "servo.rate_Hz: requires a restart");
  CHECK(result.not_applied[1] ==
        "limits.force_slew_N_per_s: is looser than 2000, which holds as long as the loop is armed; disarm, "
        "and reload again");
  s.go_for(1.5);
  CHECK(s.force_N() <= 2.0);
  CHECK(s.force().z() == Approx(std::min(2.0, 300.0 * (0.025 - s.last.X_WP[2]))).epsilon(0.02));
  // While disarmed, a reload applies the looser limit, and does not report unchanged settings again.
  s.runtime.loop().requests().disarm();
  s.go_for(0.3);
  const ReloadResult again = s.reconfigurator().reload(read);
  CHECK(again.applied == std::vector<std::string>{"limits.force_slew_N_per_s"});
  CHECK(again.not_applied == std::vector<std::string>{"servo.rate_Hz: requires a restart"});
}

TEST_CASE("a tightened limit applies in the next tick, also in contact", "[reconfigurator][reload]") {
  Configured c;
  Rig s(c.read());
  s.press();
  REQUIRE(s.force_N() > 1.2);
  c.write("[limits]\nmax_force_N = 1.0\n");
  s.reconfigurator().reload([&c] { return c.read(); });
  s.go();
  CHECK(s.force_N() <= 1.0);
  CHECK(s.force_N() > 0.99);
}

TEST_CASE("a configuration with any error is rejected as a whole", "[reconfigurator][reload]") {
  Configured c;
  Rig s(c.read());
  s.press();
  const std::uint32_t changes = s.last.change_count;
  c.write("[limits]\nmax_force_N = 1.0\n[wrench]\nstiffness = \"soft\"\n");
  CHECK_THROWS_WITH(s.reconfigurator().reload([&c] { return c.read(); }), Catch::Contains("wrenchd.toml:6:"));
  c.write("[limits]\nmax_force_N = 1.0\n");
  c.write_scene("[[obstacle]]\nmesh = \"nowhere.off\"\n");
  CHECK_THROWS_WITH(s.reconfigurator().reload([&c] { return c.read(); }), Catch::Contains("scene.toml:6:"));
  s.go_for(0.2);
  CHECK(s.last.change_count == changes);
  CHECK(s.force_N() > 1.2);
  // The corrected configuration is applied.
  c.write_scene(kTable + block("post", "[0.2, 0.0, 0.0]"));
  CHECK(s.reconfigurator().reload([&c] { return c.read(); }).applied ==
        std::vector<std::string>{"limits.max_force_N", "scene"});
  s.go_for(0.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.force_N() <= 1.0);
}

/// Returns a mesh that is not closed.
std::string open_mesh() {
  return "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
}

TEST_CASE("a thousand random changes in contact, half of them invalid, cause no jump and no torn rendering",
          "[reconfigurator][reload][long]") {
  // The energy law generates no energy, also when the tool rotates in contact.
  Configured c;
  c.write("[wrench]\nlaw = \"energy\"\n");
  RunConfig plan = c.read();
  plan.settings.simulation.hand_path = {
      {0.0, {0, 0, 0.065}, Vector3d::Zero()},     {0.5, {0, 0, 0.065}, Vector3d::Zero()},
      {1.0, {0, 0, 0.017}, Vector3d::Zero()},     {1.7, {0.01, 0.01, 0.015}, {0.1, 0.1, 0.0}},
      {2.5, {-0.01, 0, 0.017}, {-0.1, 0.1, 0.1}}, {3.0, {0, 0, 0.065}, Vector3d::Zero()}};
  plan.settings.simulation.hand_repeats = true;
  const auto simulation = plan.settings.simulation;
  Rig s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.5);
  RandomValues random(7);
  const auto number = [&random](double low, double high) { return random.uniform(low, high); };
  int rejected = 0, applied = 0, torn = 0, pushed = 0, faults = 0, unexpected = 0;
  std::string unexpected_fault = "none";
  std::map<std::uint32_t, std::uint64_t> sums{{0, s.last.rendering_checksum}};
  const auto obstacle = [&](bool good) {
    std::string text = kTable;
    if (number(0, 1) < 0.5)
      text += block("block", "[" + to_text(number(-0.08, 0.08)) + ", " + to_text(number(-0.08, 0.08)) + ", " +
                                 to_text(number(-0.03, 0.02)) + "]");
    if (!good) text += "[[obstacle]]\nmesh = \"" + c.files.write("open.off", open_mesh()).string() + "\"\n";
    return text;
  };
  for (int i = 0; i < 1000; ++i) {
    const bool good = i % 2 == 0;
    const auto gain = [&] { return to_text(good ? number(750.0, 3000.0) : -1.0); };
    try {
      switch (static_cast<int>(number(0.0, 6.0))) {
        case 0:
          s.reconfigurator().replace_scene(s.file("scene.toml", scene_text(obstacle(good))));
          break;
        case 1:
          s.reconfigurator().set_rendering(toml("[wrench]\nenergy_stiffness_per_s2 = " + gain()), "request");
          break;
        case 2:
          s.reconfigurator().move_obstacle(good ? "block" : "blok",
                                           {rotation_from({0, 0, number(-1, 1)}),
                                            {number(-0.08, 0.08), number(-0.08, 0.08), number(-0.03, 0.02)}},
                                           number(2.0, 4.0));
          break;
        case 3:
          s.reconfigurator().remove_obstacle(good ? "block" : "blok");
          break;
        case 4:
          s.reconfigurator().insert_obstacle(toml(std::string("name = \"wall\"\nhalf_space = { normal = ") +
                                                  (good ? "[0, 1, 0]" : "[0, 0, 0]") + ", offset = -0.03 }"),
                                             "request");
          break;
        default:
          c.write("[wrench]\nlaw = \"energy\"\nenergy_stiffness_per_s2 = " + gain() +
                  "\n[limits]\nforce_slew_N_per_s = " + to_text(number(1500.0, 2000.0)) + "\n");
          c.write_scene(obstacle(good));
          s.reconfigurator().reload([&] {
            RunConfig read = c.read();
            read.settings.simulation = simulation;
            return read;
          });
      }
      ++applied;
    } catch (const std::exception&) {
      ++rejected;
    }
    const auto [handed, sum] = s.reconfigurator().current_rendering();
    if (handed > 0) sums[handed] = sum;
    for (int k = static_cast<int>(number(1.0, 300.0)); k > 0; --k) {
      // A block that pushes the hand may generate more energy than the guard can remove. Then the fault
      // energy_generated ends the force, which is correct.
      const Fault fault = s.go_on();
      faults += fault != Fault::none ? 1 : 0;
      if (fault != Fault::none && fault != Fault::energy_generated && fault != Fault::motors_stalled)
        unexpected_fault = fault_row(fault).name;
      unexpected +=
          fault != Fault::none && fault != Fault::energy_generated && fault != Fault::motors_stalled ? 1 : 0;
      if (is_latched(s.state())) s.runtime.loop().requests().acknowledge();
      torn += sums.at(s.last.rendering_id) == s.last.rendering_checksum ? 0 : 1;
      pushed += s.force_N() > 0.3 ? 1 : 0;
      if (s.state() == State::disarmed) s.runtime.loop().requests().arm();
    }
  }
  INFO("applied " << applied << ", rejected " << rejected << ", ticks that pushed " << pushed
                  << ", largest step " << s.max_step_N << " N, largest generated energy " << s.max_generated_J
                  << " J");
  INFO("faults " << faults << ", the last unexpected fault " << unexpected_fault);
  CHECK(rejected >= 500);
  CHECK(applied > 250);
  CHECK(torn == 0);
  CHECK(unexpected == 0);
  CHECK(faults < 50);
  CHECK(pushed > 20000);
}

TEST_CASE("a change of rendering neither allocates nor locks in the servo thread",
          "[reconfigurator][realtime]") {
  Rig s;
  s.press();
  std::uint64_t allocations = 0, locks = 0;
  for (int i = 0; i < 4; ++i) {
    if (i % 2 == 0)
      s.reconfigurator().replace_scene(
          s.file("other.toml", scene_text(kTable + block("post", "[0.06, 0.0, 0.0]"))));
    else
      s.reconfigurator().set_rendering(toml("[wrench]\nlaw = \"energy\""), "request");
    if (i == 2) s.reconfigurator().set_scale(1.5);
    if (i == 3) s.reconfigurator().set_model(LocalModel{}, 0.2);
    const RealtimeGuard guard;
    for (int k = 0; k < 800; ++k) s.tick();
    allocations += guard.allocations();
    locks += guard.locks();
  }
  CHECK(s.last.rendering_id == 4);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace
}  // namespace wrenchd::test_reconfigurator
