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
#include "tests/support/random_values.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

// What is rendered changes while a hand is on it.

namespace wrenchd {
namespace {

using namespace test;

const std::string kMeshes = WRENCHD_SOURCE_DIR "/config/meshes/";

/// A cube of 50 mm, and what stands in its way.
std::string scene_text(const std::string& obstacles) {
  return "[tool]\nmesh = \"" + kMeshes + "cube.off\"\nscale = 0.001\nmass = 0.2\n" + obstacles;
}
const std::string kTable =
    "[[obstacle]]\nname = \"table\"\nhalf_space = { normal = [0.0, 0.0, 1.0], offset = 0.0 }\n";
std::string block(const std::string& name, const std::string& position) {
  return "[[obstacle]]\nname = \"" + name + "\"\nmesh = \"" + kMeshes +
         "cube.off\"\nscale = 0.001\nposition_m = " + position + "\n";
}

/// The shipped cube, pressed 8 mm into its table by a hand that keeps still there.
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

/// The station in virtual time, every tick held against the invariants.
struct Bench : VirtualRuntime {
  TemporaryDirectory files;
  Invariants invariants;
  double most_step_N = 0.0;  ///< of the force, from tick to tick
  double most_bend_N = 0.0;  ///< second difference
  double most_made_J = 0.0;
  int dropped_out = 0;  ///< ticks in which the state was not active

  explicit Bench(RunConfig plan = pressing_plan())
      : VirtualRuntime(std::move(plan)),
        invariants({runtime.config().profile.max_force_N, runtime.config().profile.max_torque_Nm,
                    runtime.config().settings.limits.force_slew_N_per_s,
                    runtime.config().settings.limits.torque_slew_Nm_per_s, 1e-3, 20e-3}) {}

  Reconfigurator& bench() { return runtime.reconfigurator(); }

  void go() { REQUIRE(go_on() == Fault::none); }
  Fault go_on() {
    const Vector3d before = force(), before_that = earlier_;
    const Fault fault = tick();
    const auto broken = invariants.check(last);
    REQUIRE(broken.value_or("") == "");
    most_step_N = std::max(most_step_N, (force() - before).norm());
    most_bend_N = std::max(most_bend_N, (force() - 2.0 * before + before_that).norm());
    most_made_J = std::max(most_made_J, last.injected_J);
    dropped_out += state() == State::active ? 0 : 1;
    earlier_ = before;
    return fault;
  }
  void go_for(double duration_s) {
    for (int i = 0; i < static_cast<int>(1000.0 * duration_s); ++i) go();
  }
  /// Armed, and pressed on the table until nothing moves.
  void press() {
    runtime.loop().requests().arm();
    go_for(3.0);
    REQUIRE(state() == State::active);
    REQUIRE(last.contacts == 4);
    watch_from_here();
  }
  void watch_from_here() { most_step_N = most_bend_N = most_made_J = 0.0, dropped_out = 0; }
  Vector3d force() const { return {last.F_out[0], last.F_out[1], last.F_out[2]}; }
  std::filesystem::path file(const std::string& name, const std::string& text) {
    return files.write(name, text);
  }
  /// What a tick computes from is what was handed over.
  bool whole() { return last.rendering_checksum == bench().current_rendering().checksum; }

 private:
  Vector3d earlier_ = Vector3d::Zero();
};

TomlNode toml(const std::string& text) {
  return read_toml_text(text, "request");
}

TEST_CASE("another scene with the same table under the hand is not felt", "[workbench]") {
  Bench s;
  s.press();
  const double before_N = s.force().z();
  s.bench().replace_scene(s.file("other.toml", scene_text(kTable + block("post", "[0.2, 0.0, 0.0]"))));
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.whole());
  CHECK(s.dropped_out == 0);
  CHECK(s.most_step_N < 0.02);
  CHECK(s.force().z() == Approx(before_N).epsilon(0.01));
}

TEST_CASE("a wall that goes away lets the hand go gently, and one that comes takes it gently",
          "[workbench]") {
  Bench s;
  s.press();
  REQUIRE(s.force().z() > 1.0);
  s.bench().remove_obstacle("table");
  s.go_for(1.5);
  CHECK(s.force().norm() < 1e-9);
  CHECK(s.dropped_out == 0);
  const double pace_N = 1e-3 * std::max(s.runtime.config().profile.max_force_N, 20.0);
  CHECK(s.most_step_N < 2.0 * pace_N);
  CHECK(s.most_bend_N < 2.0 * pace_N);
  // The hand is 8 mm below where the table comes back: the cube is put on top of it, and pushed there.
  s.watch_from_here();
  CHECK(s.bench().insert_obstacle(toml("name = \"table\"\nhalf_space = { normal = [0, 0, 1], offset = 0 }"),
                                  "request") == "table");
  s.go_for(2.0);
  CHECK(s.last.contacts == 4);
  CHECK(s.force().z() > 1.0);
  CHECK(s.dropped_out == 0);
  CHECK(s.most_step_N < 2.0 * pace_N);
  CHECK(s.most_made_J < 2e-3);
  CHECK((s.last.limit_causes & kPassivity) == 0);
}

TEST_CASE("an obstacle that is added may be made instead of read", "[workbench]") {
  Bench s;
  s.press();
  const char* wall =
      "name = \"wall\"\nmesh = { make = \"box\", size_m = [0.02, 0.2, 0.2] }\n"
      "position_m = [0.034, 0.0, 0.0]";
  CHECK(s.bench().insert_obstacle(toml(wall), "request") == "wall");
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.last.X_WQ[0] < -0.0009);  // its face is at 24 mm, and the cube reaches 25
  CHECK(s.bench().scene().meshes.back().mesh == "made box 0.02 x 0.2 x 0.2 m, 20000 triangles");
  const char* unknown = "name = \"pot\"\nmesh = { make = \"teapot\" }";
  CHECK_THROWS_WITH(s.bench().insert_obstacle(toml(unknown), "request"),
                    Catch::Contains("nothing of kind 'teapot'"));
}

TEST_CASE("a stiffness that is changed in contact goes over without a jump", "[workbench]") {
  Bench s;
  s.press();
  s.bench().set_rendering(toml("[wrench]\nstiffness = { linear_N_per_m = 400.0, angular_Nm_per_rad = 1.0 }"),
                          "request");
  s.go_for(1.5);
  const double depth_m = 0.025 - s.last.X_WP[2];
  CHECK(s.force().z() == Approx(400.0 * depth_m).epsilon(0.02));
  CHECK(s.most_step_N < 0.02);
  CHECK(s.dropped_out == 0);
  CHECK(s.whole());
}

TEST_CASE("the method, the law and friction can be changed in contact", "[workbench]") {
  const std::string changes =
      GENERATE(as<std::string>{}, "[rendering]\nmethod = \"translational\"", "[wrench]\nlaw = \"energy\"",
               "[rendering.friction]\nstatic = 0.5", "[wrench]\nlaw = \"pid\"");
  Bench s;
  s.press();
  s.bench().set_rendering(toml(changes), "request");
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.whole());
  CHECK(s.force().z() > 1.0);
  CHECK(s.most_step_N < 0.05);
  CHECK(s.dropped_out == 0);
}

TEST_CASE("what is refused leaves everything as it was, and says where and what to do", "[workbench]") {
  Bench s;
  s.press();
  const std::uint32_t changes = s.last.change_count;
  const auto handed_over = s.bench().current_rendering();
  const auto says = [](auto&& act) -> std::string {
    try {
      act();
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  };
  const auto refused_load =
      says([&] { s.bench().replace_scene(s.file("bad.toml", scene_text("[[obstacle]]\n"))); });
  CHECK(refused_load.find("bad.toml:5:") != std::string::npos);
  CHECK(says([&] {
          s.bench().replace_scene(s.file("bad2.toml", "[tool]\nmesh = \"" +
                                                          s.file("open.off",
                                                                 "OFF\n3 1 0\n0 0 0\n1 0 "
                                                                 "0\n0 1 0\n3 0 1 2\n")
                                                              .string() +
                                                          "\"\n"));
        }).find("open.off") != std::string::npos);
  CHECK(says([&] { s.bench().remove_obstacle("tabel"); }) ==
        "there is no obstacle 'tabel' in the scene; there are: table");
  CHECK(says([&] { s.bench().move_obstacle("table", Pose{}, 1.0); }).find("half_space") != std::string::npos);
  CHECK(says([&] {
          s.bench().insert_obstacle(toml("name = \"table\"\nhalf_space = { normal = [0, 0, 1], offset = 0 }"),
                                    "request");
        }).find("there is an obstacle 'table' already") != std::string::npos);
  CHECK(says([&] {
          s.bench().set_rendering(toml("[wrench]\nstiffness = -1.0"), "request");
        }).find("request:2:") != std::string::npos);
  CHECK(says([&] {
          s.bench().set_rendering(toml("[rendering]\nmethod = \"planar\"\nfriction.static = 0.3"), "request");
        }).find("exact") != std::string::npos);
  CHECK(says([&] { s.bench().set_scale(0.0); }).find("scale: expected 0.1 to 10") != std::string::npos);
  s.go_for(0.3);
  CHECK(s.last.change_count == changes);
  CHECK(s.last.rendering_id == 0);
  CHECK(s.bench().current_rendering().id == handed_over.id);
  CHECK(s.most_step_N < 0.02);
}

TEST_CASE("a block that is moved sets out when it is told, and pushes the tool before it",
          "[workbench][moving]") {
  Bench s;
  s.press();
  // Beside the cube, on its left; it goes through where the cube is.
  s.bench().replace_scene(s.file("block.toml", scene_text(kTable + block("block", "[0.0, 0.1, 0.02]"))));
  s.go_for(1.2);
  REQUIRE(s.last.rendering_id == 1);
  s.bench().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.03, 0.02}}, 2.0);
  s.watch_from_here();
  double most_push_m = 0.0;
  bool jumped = false;
  for (int i = 0; i < 3000; ++i) {
    s.go();
    jumped = jumped || s.last.X_WQ[1] > 1e-3;
    most_push_m = std::max(most_push_m, -s.last.X_WQ[1]);
  }
  CHECK_FALSE(jumped);
  CHECK(most_push_m >
        0.01);  // the block ends where the cube's edge is 20 mm beyond its middle; the hand yields
  CHECK(s.last.passivity_scale == 1.0);
  CHECK(s.dropped_out == 0);
  // Back again: it went where it was told, and begins there.
  s.bench().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.1, 0.02}}, 1.0);
  s.go_for(0.1);
  CHECK_THROWS_AS(s.bench().move_obstacle("block", {Quaterniond::Identity(), {0.0, 0.2, 0.02}}, 1.0),
                  BusyError);
  s.go_for(2.0);
  CHECK(std::abs(s.last.X_WQ[1]) < 0.002);
  CHECK_THROWS_WITH(s.bench().move_obstacle("block", {Quaterniond::Identity(), {9.0, 0.1, 0.02}}, 1.0),
                    Catch::Contains("give it at least duration_s = 1.8"));
}

TEST_CASE("a tool that a wall comes down on is on the side of it where the proxy was", "[workbench]") {
  Bench s;
  s.press();
  // A plate in the middle of where the hand is, and just below where the proxy stands.
  s.bench().replace_scene(
      s.file("plate.toml", scene_text("[[obstacle]]\nname = \"plate\"\nmesh = \"" + kMeshes +
                                      "cube.off\"\nscale = 0.001\nposition_m = [0.0, 0.0, -0.0251]\n")));
  s.go_for(2.0);
  CHECK(s.last.X_WQ[2] > 0.0249);
  CHECK(s.force().z() > 1.0);
  CHECK(s.dropped_out == 0);
  CHECK(s.most_step_N < 0.02);
}

TEST_CASE("where the tool fits nowhere in the new scene the force fades, and none comes back",
          "[workbench]") {
  Bench s;
  s.press();
  std::string box;
  for (const char* n : {"[1, 0, 0]", "[-1, 0, 0]", "[0, 1, 0]", "[0, -1, 0]", "[0, 0, 1]", "[0, 0, -1]"})
    box += std::string("[[obstacle]]\nhalf_space = { normal = ") + n + ", offset = 0.02 }\n";
  s.bench().replace_scene(s.file("box.toml", scene_text(box)));
  s.go_for(1.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(static_cast<ProxyInitialization>(s.last.proxy_initialization) == ProxyInitialization::failed);
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == State::waiting);
  CHECK(s.most_step_N < 0.1);
}

TEST_CASE("with the clutch in the hand goes elsewhere without force, and goes on where the tool stood",
          "[workbench][workspace]") {
  RunConfig plan = pressing_plan();
  auto& path = plan.settings.simulation.hand_path;
  path.push_back({3.5, {0, 0, 0.017}, Vector3d::Zero()});
  path.push_back({4.5, {0.03, 0, 0.057}, {0.0, 0.0, 0.4}});  // 40 mm up
  path.push_back({5.5, {0.03, 0, 0.057}, {0.0, 0.0, 0.4}});
  path.push_back({6.0, {0.03, 0, 0.049}, {0.0, 0.0, 0.4}});  // and down again by 8
  Bench s(plan);
  s.press();
  s.bench().set_clutched(true);
  s.go_for(0.3);
  CHECK(s.force_N() == 0.0);
  CHECK(s.most_step_N < 0.2);
  const auto X_WP = s.last.X_WP;
  s.go_for(2.0);
  CHECK(s.last.X_WP == X_WP);
  s.bench().set_clutched(false);
  s.watch_from_here();
  s.go_for(0.2);
  CHECK(s.last.X_WP[2] == Approx(0.025).margin(1e-3));  // it lies on the table, and is not pressed
  CHECK(s.most_step_N < 0.1);
  s.go_for(1.5);
  CHECK(s.force().z() > 1.0);
  CHECK(s.dropped_out == 0);
}

TEST_CASE("the scale of the workspace changes without moving the tool, and what is felt keeps its power",
          "[workbench][workspace]") {
  Bench s;
  s.press();
  const double z_m = s.last.X_WP[2];
  s.bench().set_scale(2.0);
  s.go_for(0.5);
  CHECK(s.most_step_N < 0.1);
  CHECK(s.dropped_out == 0);
  CHECK(std::abs(s.last.X_WP[2] - z_m) < 3e-3);
  const double depth_m = 0.025 - s.last.X_WP[2];
  CHECK(s.force().z() == Approx(2.0 * 600.0 * depth_m).epsilon(0.03));
  s.bench().recentre();
  s.go_for(0.06);
  CHECK(s.force_N() == 0.0);
  s.go_for(0.2);
  CHECK(s.last.X_WP[2] == Approx(2.0 * s.last.X_BH[2]).margin(1e-9));
}

TEST_CASE("a scale that is there at once, for it was asked with the tool called back, is borne like any",
          "[workbench][workspace]") {
  const auto share_of = [](bool recentred) {
    RunConfig plan = pressing_plan();
    plan.settings.servo.self_test_s = 0.5;  // in which is measured what the device bears
    for (std::size_t i = 1; i < plan.settings.simulation.hand_path.size(); ++i)
      plan.settings.simulation.hand_path[i].time_s += 0.6;
    Bench s(plan);
    s.go_for(0.6);
    s.press();
    if (recentred) s.bench().set_clutched(true);
    s.bench().set_scale(8.0);
    if (recentred) {
      s.bench().recentre();
      s.bench().set_clutched(false);
    }
    s.go_for(0.5);
    return s.last.stiffness_scale;
  };
  const double gradually = share_of(false);
  CHECK(gradually < 0.9);
  CHECK(share_of(true) == gradually);
}

TEST_CASE("a local model pushes, and fades out when its client is silent", "[workbench][models]") {
  RunConfig plan = pressing_plan();
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()}};
  Bench s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.0);
  REQUIRE(s.state() == State::active);
  s.watch_from_here();
  LocalModel wall;
  wall.id = 1;
  wall.kind = LocalModel::Kind::plane;
  wall.normal_W = {0, 0, 2.0};
  wall.offset_m = 2.0 * 0.067;
  wall.stiffness_N_per_m = 500.0;
  s.bench().set_model(wall, 0.3);
  s.go_for(0.25);
  CHECK(s.force().z() == Approx(500.0 * (0.067 - s.last.X_BH[2])).epsilon(0.05));
  CHECK(s.force().z() > 0.2);
  s.bench().set_model(wall, 0.3);  // said again in time
  s.go_for(0.2);
  CHECK(s.force().z() > 0.2);
  s.go_for(0.12);
  CHECK(s.force_N() == 0.0);
  CHECK(s.most_step_N < 0.05);
  CHECK(s.dropped_out == 0);
  CHECK(s.most_made_J < 1e-3);
  wall.stiffness_N_per_m = -1.0;
  CHECK_THROWS_WITH(s.bench().set_model(wall, 0.3), Catch::Contains("stiffness_N_per_m: expected 0 to"));
  wall.stiffness_N_per_m = 1.0;
  CHECK_THROWS_WITH(s.bench().set_model(wall, 60.0), Catch::Contains("send it again"));
}

TEST_CASE("a local model that is stiffer than the device bears is felt softer", "[workbench][models]") {
  RunConfig plan = pressing_plan();
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()}};
  Bench s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.0);
  LocalModel spring;
  spring.kind = LocalModel::Kind::spring;
  spring.X_WA = {Quaterniond::Identity(), {0, 0, 0.066}};
  spring.stiffness_N_per_m = 20000.0;
  s.bench().set_model(spring, 5.0);
  s.go_for(1.0);
  CHECK(s.state() == State::active);
  CHECK(s.force().z() < 0.7 * 20000.0 * (0.066 - s.last.X_BH[2]));
  CHECK(s.most_made_J < 2e-3);
}

/// The shipped configuration in files of its own, to be changed.
struct Configured {
  TemporaryDirectory files;
  std::filesystem::path config, scene;

  Configured() {
    write_scene(kTable);
    write("");
  }
  /// With Eq. (16), unless the text names a law.
  void write(std::string more) {
    const std::string table = "[wrench]\n", law = "law = \"pid\"\n";
    if (more.find(table) == std::string::npos) more += table;
    if (more.find("law = ") == std::string::npos) more.insert(more.find(table) + table.size(), law);
    config = files.write("wrenchd.toml", "scene = \"scene.toml\"\n" + more);
  }
  void write_scene(const std::string& obstacles) { scene = files.write("scene.toml", scene_text(obstacles)); }
  RunConfig read() const {
    RunConfig plan = load_run_config({config, {}, {}, false}, SearchPath({WRENCHD_SOURCE_DIR "/config"}));
    const RunConfig pressing = pressing_plan();
    plan.settings.servo.self_test_s = 0.0;
    plan.settings.simulation = pressing.settings.simulation;
    return plan;
  }
};

TEST_CASE("a configuration that is read again is applied whole, but for what requires a restart",
          "[workbench][reload]") {
  Configured c;
  Bench s(c.read());
  s.press();
  const auto read = [&c] { return c.read(); };
  CHECK(s.bench().reload(read).applied.empty());
  c.write(
      "[servo]\nrate_Hz = 2000.0\n[wrench]\nstiffness = { linear_N_per_m = 300.0, angular_Nm_per_rad = 1.0 "
      "}\n[limits]\nmax_force_N = 2.0\nforce_slew_N_per_s = 5000.0\n");
  const ReloadResult result = s.bench().reload(read);
  CHECK(result.applied == std::vector<std::string>{"wrench.stiffness", "limits.max_force_N"});
  REQUIRE(result.not_applied.size() == 2);
  CHECK(result.not_applied[0] == "servo.rate_Hz: requires a restart");
  CHECK(result.not_applied[1] ==
        "limits.force_slew_N_per_s: is looser than 2000, which holds as long as the loop is armed; disarm, "
        "and reload again");
  s.go_for(1.5);
  CHECK(s.force_N() <= 2.0);
  CHECK(s.force().z() == Approx(std::min(2.0, 300.0 * (0.025 - s.last.X_WP[2]))).epsilon(0.02));
  // Disarmed, what was looser is taken; what was not changed since is not told again.
  s.runtime.loop().requests().disarm();
  s.go_for(0.3);
  const ReloadResult again = s.bench().reload(read);
  CHECK(again.applied == std::vector<std::string>{"limits.force_slew_N_per_s"});
  CHECK(again.not_applied == std::vector<std::string>{"servo.rate_Hz: requires a restart"});
}

TEST_CASE("a limit that is tightened holds in the next tick, in the middle of a push",
          "[workbench][reload]") {
  Configured c;
  Bench s(c.read());
  s.press();
  REQUIRE(s.force_N() > 1.2);
  c.write("[limits]\nmax_force_N = 1.0\n");
  s.bench().reload([&c] { return c.read(); });
  s.go();
  CHECK(s.force_N() <= 1.0);
  CHECK(s.force_N() > 0.99);
}

TEST_CASE("a configuration with anything wrong in it is refused whole", "[workbench][reload]") {
  Configured c;
  Bench s(c.read());
  s.press();
  const std::uint32_t changes = s.last.change_count;
  c.write("[limits]\nmax_force_N = 1.0\n[wrench]\nstiffness = \"soft\"\n");
  CHECK_THROWS_WITH(s.bench().reload([&c] { return c.read(); }), Catch::Contains("wrenchd.toml:6:"));
  c.write("[limits]\nmax_force_N = 1.0\n");
  c.write_scene("[[obstacle]]\nmesh = \"nowhere.off\"\n");
  CHECK_THROWS_WITH(s.bench().reload([&c] { return c.read(); }), Catch::Contains("scene.toml:6:"));
  s.go_for(0.2);
  CHECK(s.last.change_count == changes);
  CHECK(s.force_N() > 1.2);
  // Mended, it is applied.
  c.write_scene(kTable + block("post", "[0.2, 0.0, 0.0]"));
  CHECK(s.bench().reload([&c] { return c.read(); }).applied ==
        std::vector<std::string>{"limits.max_force_N", "scene"});
  s.go_for(0.5);
  CHECK(s.last.rendering_id == 1);
  CHECK(s.force_N() <= 1.0);
}

/// A mesh of an obstacle that is not closed.
std::string open_mesh() {
  return "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
}

TEST_CASE("a thousand random changes under a hand that presses, half of them wrong, and nothing jumps",
          "[workbench][reload]") {
  // The law that gives nothing of its own, however the tool turns in contact.
  Configured c;
  c.write("[wrench]\nlaw = \"energy\"\n");
  RunConfig plan = c.read();
  plan.settings.simulation.hand_path = {
      {0.0, {0, 0, 0.065}, Vector3d::Zero()},     {0.5, {0, 0, 0.065}, Vector3d::Zero()},
      {1.0, {0, 0, 0.017}, Vector3d::Zero()},     {1.7, {0.01, 0.01, 0.015}, {0.1, 0.1, 0.0}},
      {2.5, {-0.01, 0, 0.017}, {-0.1, 0.1, 0.1}}, {3.0, {0, 0, 0.065}, Vector3d::Zero()}};
  plan.settings.simulation.hand_repeats = true;
  const auto simulation = plan.settings.simulation;
  Bench s(plan);
  s.runtime.loop().requests().arm();
  s.go_for(2.5);
  RandomValues random(7);
  const auto number = [&random](double low, double high) { return random.uniform(low, high); };
  int refused = 0, applied = 0, torn = 0, pushed = 0, faults = 0, strange = 0;
  std::string name_of_strange = "none";
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
          s.bench().replace_scene(s.file("scene.toml", scene_text(obstacle(good))));
          break;
        case 1:
          s.bench().set_rendering(toml("[wrench]\nenergy_stiffness_per_s2 = " + gain()), "request");
          break;
        case 2:
          s.bench().move_obstacle(good ? "block" : "blok",
                                  {rotation_from({0, 0, number(-1, 1)}),
                                   {number(-0.08, 0.08), number(-0.08, 0.08), number(-0.03, 0.02)}},
                                  number(2.0, 4.0));
          break;
        case 3:
          s.bench().remove_obstacle(good ? "block" : "blok");
          break;
        case 4:
          s.bench().insert_obstacle(toml(std::string("name = \"wall\"\nhalf_space = { normal = ") +
                                         (good ? "[0, 1, 0]" : "[0, 0, 0]") + ", offset = -0.03 }"),
                                    "request");
          break;
        default:
          c.write("[wrench]\nlaw = \"energy\"\nenergy_stiffness_per_s2 = " + gain() +
                  "\n[limits]\nforce_slew_N_per_s = " + to_text(number(1500.0, 2000.0)) + "\n");
          c.write_scene(obstacle(good));
          s.bench().reload([&] {
            RunConfig read = c.read();
            read.settings.simulation = simulation;
            return read;
          });
      }
      ++applied;
    } catch (const std::exception&) {
      ++refused;
    }
    const auto [handed, sum] = s.bench().current_rendering();
    if (handed > 0) sums[handed] = sum;
    for (int k = static_cast<int>(number(1.0, 300.0)); k > 0; --k) {
      // A block that shoves the hand is more than the guard gives back, and ends the force: that is its
      // right.
      const Fault fault = s.go_on();
      faults += fault != Fault::none ? 1 : 0;
      if (fault != Fault::none && fault != Fault::energy_generated && fault != Fault::motors_stalled)
        name_of_strange = fault_row(fault).name;
      strange +=
          fault != Fault::none && fault != Fault::energy_generated && fault != Fault::motors_stalled ? 1 : 0;
      if (is_latched(s.state())) s.runtime.loop().requests().acknowledge();
      torn += sums.at(s.last.rendering_id) == s.last.rendering_checksum ? 0 : 1;
      pushed += s.force_N() > 0.3 ? 1 : 0;
      if (s.state() == State::disarmed) s.runtime.loop().requests().arm();
    }
  }
  INFO("applied " << applied << ", refused " << refused << ", ticks that pushed " << pushed << ", most step "
                  << s.most_step_N << " N, most energy from nowhere " << s.most_made_J << " J");
  INFO("faults " << faults << ", the last strange one " << name_of_strange);
  CHECK(refused >= 500);
  CHECK(applied > 250);
  CHECK(torn == 0);
  CHECK(strange == 0);
  CHECK(faults < 50);
  CHECK(pushed > 20000);
}

TEST_CASE("a rendering that takes the place of another neither allocates nor locks in the servo thread",
          "[workbench][realtime]") {
  Bench s;
  s.press();
  std::uint64_t allocations = 0, locks = 0;
  for (int i = 0; i < 4; ++i) {
    if (i % 2 == 0)
      s.bench().replace_scene(s.file("other.toml", scene_text(kTable + block("post", "[0.06, 0.0, 0.0]"))));
    else
      s.bench().set_rendering(toml("[wrench]\nlaw = \"energy\""), "request");
    if (i == 2) s.bench().set_scale(1.5);
    if (i == 3) s.bench().set_model(LocalModel{}, 0.2);
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
}  // namespace wrenchd
