// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <numbers>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/running_daemon.hpp"
#include "tools/live_scene.hpp"

namespace wrenchd::test_live_scene {

namespace {

using namespace test;
using Catch::Contains;
namespace fs = std::filesystem;

TEST_CASE("a vector is three words, or one word with commas", "[live_scene]") {
  CHECK(vector_of({"0", "-0.1", "2e-3"}, "--position") == std::vector<double>{0.0, -0.1, 0.002});
  CHECK(vector_of({"0,-0.1,2e-3"}, "--position") == std::vector<double>{0.0, -0.1, 0.002});
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"1", "2"}, {"1", "2", "x"}, {"1,2,"}, {"1", "2", "nan"}, {"1,2,3,4"}, {""}})
    CHECK_THROWS_WITH(vector_of(words, "--normal"),
                      Contains("--normal: expected three numbers, as in --normal 0 0.1 0"));
}

TEST_CASE("an obstacle is a mesh file, a generated mesh or a half space", "[live_scene]") {
  const std::string cube = source_path("config/meshes/cube.off");
  SceneEdit file;
  file.subject = cube;
  file.name = "block";
  file.scale = 0.001;
  file.position_m = {"0", "0.2", "0"};
  file.rotation_deg = {"0", "0", "90"};
  const Json block = obstacle_request(file);
  CHECK(block["mesh"] == cube);
  CHECK(block["name"] == "block");
  CHECK(block["position_m"] == Json({0.0, 0.2, 0.0}));
  CHECK(block["rotation_vector_rad"][2].get<double>() == Approx(0.5 * std::numbers::pi));

  SceneEdit gear;
  gear.subject = "gear";
  gear.triangles = 500;
  CHECK(obstacle_request(gear) == Json{{"mesh", {{"make", "gear"}, {"triangles", 500}}}});

  SceneEdit floor;
  floor.subject = "half_space";
  floor.normal = {"0", "0", "1"};
  floor.offset_m = -0.1;
  CHECK(obstacle_request(floor) == Json{{"half_space", {{"normal", {0.0, 0.0, 1.0}}, {"offset", -0.1}}}});
}

TEST_CASE("options that do not belong to the shape of an obstacle are rejected", "[live_scene]") {
  const auto rejection = [](const SceneEdit& edit) -> std::string {
    try {
      obstacle_request(edit);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  };
  SceneEdit edit;
  edit.subject = "half_space";
  CHECK_THAT(rejection(edit), Contains("--normal and --offset are missing"));
  edit.position_m = {"0", "0", "0"};
  CHECK_THAT(rejection(edit), Contains("scene add half_space: accepts no --position"));
  edit = {};
  edit.subject = "gear";
  edit.normal = {"0", "0", "1"};
  CHECK_THAT(rejection(edit), Contains("only half_space does"));
  edit = {};
  edit.subject = source_path("config/meshes/cube.off");
  edit.triangles = 100;
  CHECK_THAT(rejection(edit), Contains("only a generated mesh does"));
  edit = {};
  edit.subject = "gaer";
  CHECK_THAT(rejection(edit),
             Contains("'gaer' is neither a file nor a kind of obstacle; did you mean 'gear'?"));
  edit.subject = source_path("config/meshes/cueb.off");
  CHECK_THAT(rejection(edit), Contains("did you mean '" + source_path("config/meshes/cube.off") + "'?"));
  edit.subject = "bananas";
  CHECK_THAT(rejection(edit), Contains("name a mesh file, or one of half_space, "));
}

TEST_CASE("wrenchctl scene adds, moves and removes obstacles, each with its undo", "[live_scene]") {
  const MachineLoad load;
  const RunningDaemon daemon;
  REQUIRE_RATE(load, daemon.program.wait_for_output("state: disarmed"));
  const auto obstacles = [&] { return daemon.ask({"scene", "list"})["obstacles"]; };
  CHECK(daemon.ctl({"scene"}).out == daemon.ctl({"scene", "list"}).out);
  CHECK_THAT(daemon.ctl({"scene"}).out,
             Contains("table") && Contains("half_space, normal 0 0 1, offset 0 m"));

  const ProgramResult added =
      daemon.ctl({"scene", "add", "cube", "--name", "block", "--position", "0", "0.2", "0"});
  INFO(added.err);
  CHECK(added.exit_code == 0);
  CHECK(added.out == "added block\nundo: wrenchctl scene remove block\n");
  CHECK(obstacles().size() == 2);

  const ProgramResult moved =
      daemon.ctl({"scene", "move", "block", "--position", "0,0.3,0", "--duration", "0.2"});
  INFO(moved.err);
  CHECK(moved.exit_code == 0);
  CHECK_THAT(moved.out,
             Contains("block: position 0 0.2 0 -> 0 0.3 0 m") &&
                 Contains("undo: wrenchctl scene move block --position 0 0.2 0 --rotation 0 0 0\n"));
  bool arrived = false;
  for (int i = 0; i < 100 && !arrived; ++i) {
    const Json present = obstacles();
    arrived = present[1]["position_m"][1].get<double>() == Approx(0.3);
  }
  CHECK(arrived);

  CHECK_THAT(daemon.ctl({"scene", "remove", "blok"}).err,
             Contains("there is no obstacle 'blok' in the scene; did you mean 'block'?"));
  CHECK_THAT(daemon.ctl({"scene", "move", "table", "--position", "0", "0", "0"}).err,
             Contains("a half_space cannot move"));
  CHECK_THAT(daemon.ctl({"scene", "move", "block"}).err, Contains("the goal is missing"));
  CHECK_THAT(daemon.ctl({"scene", "remove", "block"}).out, Contains("removed block\n"));

  const ProgramResult removed = daemon.ctl({"scene", "remove", "table"});
  CHECK(removed.out ==
        "removed table\nundo: wrenchctl scene add half_space --name table --normal 0 0 1 --offset 0\n");
  CHECK(obstacles().empty());
  CHECK(
      daemon
          .ctl({"scene", "add", "half_space", "--name", "table", "--normal", "0", "0", "1", "--offset", "0"})
          .exit_code == 0);
  CHECK(obstacles()[0]["name"] == "table");
}

TEST_CASE("wrenchctl scene load finds files as the other commands do, and reset loads the file again",
          "[live_scene]") {
  const MachineLoad load;
  const RunningDaemon daemon;
  REQUIRE_RATE(load, daemon.program.wait_for_output("state: disarmed"));
  const ProgramResult loaded = daemon.ctl({"scene", "load", "cube_over_plunger"});
  INFO(loaded.err);
  CHECK(loaded.exit_code == 0);
  CHECK_THAT(loaded.out, Contains("cube_over_plunger.toml, 2 obstacles\n") &&
                             Contains("undo: wrenchctl scene load ") && Contains("cube_on_table.toml\n"));
  CHECK(daemon.ctl({"scene", "remove", "table"}).exit_code == 0);
  CHECK_THAT(daemon.ctl({"scene", "reset"}).out, Contains("cube_over_plunger.toml, 2 obstacles\n"));

  // A relative name is one of the working directory of wrenchctl.
  daemon.dir.write("here.toml", "[tool]\nmesh = { make = \"cube\" }\n");
  const fs::path before = fs::current_path();
  fs::current_path(daemon.dir.path());
  const ProgramResult relative = daemon.ctl({"scene", "load", "here.toml"});
  fs::current_path(before);
  INFO(relative.err);
  CHECK_THAT(relative.out, Contains((daemon.dir.path() / "here.toml").string() + ", 0 obstacles\n"));

  const ProgramResult none = daemon.ctl({"scene", "load", "scenes/cube_over_plungr.toml"});
  CHECK(none.exit_code == 1);
  CHECK_THAT(none.err, Contains("no such file; searched ") && Contains("scenes/cube_over_plunger.toml'?"));
}

}  // namespace
}  // namespace wrenchd::test_live_scene
