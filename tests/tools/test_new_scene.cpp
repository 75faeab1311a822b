// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <fstream>
#include <string>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "daemon/run_config.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/new_scene.hpp"

namespace wrenchd::test_new_scene {

using namespace wrenchd::test;
namespace fs = std::filesystem;

namespace {

/// Largest force of a run of this configuration in virtual time [N], from its summary.
double largest_force_N(const fs::path& config) {
  const ProgramResult run = run_program(
      "wrenchd", {"--config", config.string(), "--virtual-time", "--seconds", "3", "--arm", "--live"});
  INFO(run.err);
  REQUIRE(run.exit_code == 0);
  const std::string words = "largest force ";
  const auto at = run.out.rfind(words);
  REQUIRE(at != std::string::npos);
  return std::stod(run.out.substr(at + words.size()));
}

/// A tetrahedron of this side whose frame is far from it, as in CAD files; open: without its base.
fs::path tetrahedron(const TemporaryDirectory& dir, double side, bool open = false) {
  const auto number = [&](double x) { return std::to_string(x * side + 3.0 * side) + " "; };
  std::string text = std::string("OFF\n4 ") + (open ? "3" : "4") + " 0\n";
  for (const auto& [x, y, z] : {std::array{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.3, 0.3, 0.8}})
    text += number(x) + number(y) + number(z) + "\n";
  text += "3 0 1 3\n3 1 2 3\n3 2 0 3\n";
  if (!open) text += "3 0 2 1\n";
  return dir.write(open ? "open.off" : "part.off", text);
}

}  // namespace

TEST_CASE("a new scene arms and touches at once, whatever the unit and the origin of the mesh are",
          "[new_scene]") {
  const TemporaryDirectory dir;
  for (const double side : {0.05, 60.0}) {  // metres, millimetres
    const fs::path part = tetrahedron(dir, side);
    const fs::path name = dir.path() / ("scene" + std::to_string(static_cast<int>(side)));
    const ProgramResult made = run_program("wrenchctl", {"new", name.string(), "--tool", part.string()});
    INFO(made.err);
    REQUIRE(made.exit_code == 0);
    CHECK(made.out.find(side < 1.0 ? "taken as metres" : "taken as millimetres") != std::string::npos);
    const double force_N = largest_force_N(name / "wrenchd.toml");
    CHECK(force_N > 0.5);
    CHECK(force_N < 5.0);
    CHECK(run_program("wrenchctl", {"check", (name / "wrenchd.toml").string()}).exit_code == 0);
  }
}

TEST_CASE("a new scene with an obstacle lowers the tool until it touches", "[new_scene]") {
  const TemporaryDirectory dir;
  const std::string gear = (dir.path() / "gear.off").string();
  REQUIRE(run_program("wrenchctl", {"mesh", "--make", "gear", "--triangles", "2000", "-o", gear}).exit_code ==
          0);
  const fs::path name = dir.path() / "on_gear";
  const ProgramResult made = run_program(
      "wrenchctl", {"new", name.string(), "--tool", tetrahedron(dir, 0.03).string(), "--obstacle", gear});
  INFO(made.err);
  REQUIRE(made.exit_code == 0);
  CHECK(largest_force_N(name / "wrenchd.toml") > 0.5);
}

TEST_CASE("an open mesh becomes a surface, and the output says why", "[new_scene]") {
  const TemporaryDirectory dir;
  const fs::path name = dir.path() / "mine";
  const ProgramResult made =
      run_program("wrenchctl", {"new", name.string(), "--tool", tetrahedron(dir, 0.05, true).string()});
  INFO(made.err);
  REQUIRE(made.exit_code == 0);
  CHECK(made.out.find("kind = \"surface\"") != std::string::npos);
  CHECK(largest_force_N(name / "wrenchd.toml") > 0.5);
}

TEST_CASE("a rejected new scene leaves nothing behind", "[new_scene]") {
  const TemporaryDirectory dir;
  const auto entries = [&] {
    return std::distance(fs::directory_iterator(dir.path()), fs::directory_iterator());
  };
  const fs::path part = tetrahedron(dir, 0.05);
  const fs::path bad = dir.write("bad.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 nonsense\n3 0 1 2\n");
  const auto before = entries();
  const auto rejected = [&](const fs::path& name, const fs::path& tool) {
    const ProgramResult made = run_program("wrenchctl", {"new", name.string(), "--tool", tool.string()});
    CHECK(made.exit_code == 1);
    CHECK(entries() == before);
    return made.err;
  };
  CHECK(rejected(dir.path() / "x", bad).find("bad.off") != std::string::npos);
  CHECK(rejected(dir.path() / "x", dir.path() / "missing.stl").find("missing.stl") != std::string::npos);
  CHECK(rejected(dir.path() / "no" / "such" / "x", part).find("name a directory in one that exists") !=
        std::string::npos);
  CHECK(rejected(part, part).find("exists already") != std::string::npos);
  CHECK(rejected(dir.path(), part).find("exists already") != std::string::npos);
}

}  // namespace wrenchd::test_new_scene
