// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_scene.hpp"
#include "config/scene_text.hpp"
#include "config/toml_file.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_scene_text {

namespace {

using Catch::Contains;

SceneSettings read_back(const std::string& text) {
  return load_scene(read_toml_text(text, "/scene.toml"), "/scene.toml");
}

const std::string kCube = test::source_path("config/meshes/cube.off");

TEST_CASE("the text of a scene reads back as the same scene", "[scene_text]") {
  SceneSettings scene;
  scene.tool = {kCube, 0.001, 0.25, {}};
  scene.surface_tolerance_m = 2e-6;
  scene.half_spaces.push_back({"table \"A\" \\", Vector3d(0.0, 0.6, 0.8), -0.01});
  MeshObstacleSettings rest;
  rest.name = "post";
  rest.mesh = kCube;
  rest.scale = 0.002;
  rest.X_WM = {rotation_from({0.1, -0.2, 0.3}), {0.01, 0.02, 0.03}};
  rest.kind = BodyKind::surface;
  scene.meshes.push_back(rest);
  MeshObstacleSettings made;
  made.name = "made";
  made.generated.emplace();
  made.generated->kind = "bumpy";
  made.generated->triangles = 500;
  made.generated->seed = 7;
  made.mesh = generated_mesh_name(*made.generated);
  made.motion.linear_m_per_s = {0.1, 0.0, 0.0};
  made.motion.start_s = 2.0;
  made.motion.reverse_after_s = 10.0;
  scene.meshes.push_back(made);

  const std::string text = scene_text(scene, 3.0);
  INFO(text);
  const SceneSettings again = read_back(text);
  CHECK(again.tool.mesh == scene.tool.mesh);
  CHECK(again.tool.mass_kg == 0.25);
  CHECK(again.surface_tolerance_m == 2e-6);
  REQUIRE(again.half_spaces.size() == 1);
  CHECK(again.half_spaces[0].name == scene.half_spaces[0].name);
  CHECK((again.half_spaces[0].normal_W - scene.half_spaces[0].normal_W).norm() < 1e-15);
  REQUIRE(again.meshes.size() == 2);
  CHECK(again.meshes[0].kind == BodyKind::surface);
  CHECK((again.meshes[0].X_WM.translation_m - rest.X_WM.translation_m).norm() < 1e-15);
  CHECK(again.meshes[0].X_WM.rotation.angularDistance(rest.X_WM.rotation) < 1e-7);
  CHECK(again.meshes[1].mesh == made.mesh);
  CHECK(again.meshes[1].motion.linear_m_per_s == made.motion.linear_m_per_s);
  CHECK(again.meshes[1].motion.reverse_after_s == 10.0);
  CHECK((again.meshes[1].X_WM.translation_m - Vector3d(0.1, 0.0, 0.0)).norm() <
        1e-12);  // 1 s after its start
}

TEST_CASE("the text of a scene keeps kind, inertia and parts of the tool", "[scene_text]") {
  SceneSettings scene;
  scene.tool.mesh = kCube;
  scene.tool.kind = BodyKind::surface;
  scene.tool.inertia_source = InertiaSource::hull;
  ToolSettings again = read_back(scene_text(scene, 0.0)).tool;
  CHECK(again.kind == BodyKind::surface);
  CHECK(again.inertia_source == InertiaSource::hull);

  scene.tool.inertia_source = InertiaSource::shell;
  scene.tool.shell_thickness_m = 0.002;
  again = read_back(scene_text(scene, 0.0)).tool;
  CHECK(again.inertia_source == InertiaSource::shell);
  CHECK(again.shell_thickness_m == 0.002);

  scene.tool.inertia_source = InertiaSource::given;
  scene.tool.centre_of_mass_m = {0.001, -0.002, 0.003};
  scene.tool.inertia_kg_m2 << 3e-5, 1e-6, 2e-6, 1e-6, 4e-5, 3e-6, 2e-6, 3e-6, 5e-5;
  again = read_back(scene_text(scene, 0.0)).tool;
  CHECK(again.inertia_source == InertiaSource::given);
  CHECK(again.centre_of_mass_m == scene.tool.centre_of_mass_m);
  CHECK((again.inertia_kg_m2 - scene.tool.inertia_kg_m2).norm() < 1e-20);

  scene.tool = {};
  scene.tool.mesh = kCube;
  scene.tool.parts = {kCube, kCube};
  MeshObstacleSettings pair;
  pair.name = "pair";
  pair.mesh = kCube;
  pair.parts = {kCube, kCube};
  scene.meshes.push_back(pair);
  const SceneSettings both = read_back(scene_text(scene, 0.0));
  CHECK(both.tool.parts.size() == 2);
  CHECK(both.tool.mesh == scene.tool.mesh);
  REQUIRE(both.meshes.size() == 1);
  CHECK(both.meshes[0].parts.size() == 2);
}

TEST_CASE("a motion that ends is left out of the text of a scene, at the pose of that time", "[scene_text]") {
  SceneSettings scene;
  scene.tool.mesh = kCube;
  MeshObstacleSettings moved;
  moved.name = "moved";
  moved.mesh = kCube;
  moved.motion.linear_m_per_s = {0.0, 0.5, 0.0};
  moved.motion.duration_s = 2.0;
  scene.meshes.push_back(moved);
  const SceneSettings again = read_back(scene_text(scene, 1.0));
  CHECK_FALSE(again.meshes.at(0).motion.moves());
  CHECK((again.meshes[0].X_WM.translation_m - Vector3d(0.0, 0.5, 0.0)).norm() < 1e-12);
}

}  // namespace
}  // namespace wrenchd::test_scene_text
