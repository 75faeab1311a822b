// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/clear_start.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_clear_start {

using namespace wrenchd::test;

namespace {

/// The shipped scene with its table at this height [m]; the shipped hand starts with the tool at 40 mm.
std::optional<Vector3d> displacement(double table_m, double base_yaw_rad = 0.0) {
  RunConfig plan = shipped_config();
  plan.scene.half_spaces.front().offset_m = table_m;
  plan.settings.device.base_in_world.rotation_vector_rad = {0.0, 0.0, base_yaw_rad};
  return displacement_to_clear_start(Scene(plan.scene), plan.settings);
}

}  // namespace

TEST_CASE("a hand that starts clear keeps its path", "[clear_start]") {
  REQUIRE(displacement(0.0).has_value());
  CHECK(displacement(0.0)->norm() == 0.0);
  CHECK(displacement(0.039)->norm() == 0.0);
}

TEST_CASE("a hand that starts in an obstacle is displaced until it is armed before it touches",
          "[clear_start]") {
  const auto d_B_m = displacement(0.070, 0.7);
  REQUIRE(d_B_m.has_value());
  CHECK(d_B_m->z() > 0.030);  // the depth at the start
  CHECK(d_B_m->z() < 0.100);
  CHECK(d_B_m->head<2>().norm() < 1e-9);
}

TEST_CASE("a scene in which the simulated hand would start inside an obstacle gives a force",
          "[clear_start]") {
  const TemporaryDirectory dir;
  const auto scene = dir.write("scene.toml",
                               "[tool]\nmesh = { make = \"cube\", triangles = 12 }\n[[obstacle]]\n"
                               "half_space = { normal = [0.0, 0.0, 1.0], offset = 0.06 }\n");
  const ProgramResult run = run_program(
      "wrenchd", {"--scene", scene.string(), "--virtual-time", "--seconds", "4", "--arm", "--live"});
  INFO(run.err << run.out);
  REQUIRE(run.exit_code == 0);
  CHECK(run.err.find("its path is displaced by") != std::string::npos);
  const std::string words = "largest force ";
  const auto at = run.out.rfind(words);
  REQUIRE(at != std::string::npos);
  CHECK(std::stod(run.out.substr(at + words.size())) > 0.5);
}

}  // namespace wrenchd::test_clear_start
