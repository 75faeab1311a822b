// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/scene_cost.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_scene_cost {

namespace {

using namespace test;
using Catch::Contains;

MeshObstacleSettings made(std::size_t triangles) {
  MeshObstacleSettings obstacle;
  obstacle.generated.emplace();
  obstacle.generated->kind = "boulder";
  obstacle.generated->triangles = triangles;
  obstacle.mesh = generated_mesh_name(*obstacle.generated);
  return obstacle;
}

TEST_CASE("a change over the control socket may add a bounded number of triangles", "[scene_cost]") {
  const SceneSettings present = shipped_config().scene;
  SceneSettings scene = present;
  scene.meshes.push_back(made(kMaxAddedTriangles - 1000));
  CHECK_NOTHROW(check_scene_cost(scene, present));
  scene.meshes.push_back(scene.meshes.back());  // the same mesh once more costs nothing
  CHECK_NOTHROW(check_scene_cost(scene, present));
  scene.meshes.push_back(made(2000));
  CHECK_THROWS_WITH(check_scene_cost(scene, present),
                    Contains("2001000 triangles") && Contains("use fewer triangles"));
  CHECK_NOTHROW(check_scene_cost(scene, scene));  // a scene that is there already costs nothing
}

TEST_CASE("the cost of a mesh file follows from its size, before it is read", "[scene_cost]") {
  const TemporaryDirectory files;
  const SceneSettings present = shipped_config().scene;
  SceneSettings scene = present;
  MeshObstacleSettings obstacle;
  obstacle.mesh = files.write("large.STL", "");
  scene.meshes.push_back(obstacle);
  std::filesystem::resize_file(obstacle.mesh, 50 * (kMaxAddedTriangles - 1));
  CHECK_NOTHROW(check_scene_cost(scene, present));
  std::filesystem::resize_file(obstacle.mesh, 50 * (kMaxAddedTriangles + 1));
  CHECK_THROWS_WITH(check_scene_cost(scene, present), Contains("at most 2000000"));
}

TEST_CASE("ten million generated triangles are rejected before they are made", "[scene_cost]") {
  VirtualRuntime r;
  TomlNode obstacle =
      read_toml_text("name = \"huge\"\nmesh = { make = \"boulder\", triangles = 10000000 }\n", "scene.add");
  CHECK_THROWS_WITH(r.runtime.reconfigurator().insert_obstacle(obstacle, "scene.add"),
                    Contains("10000000 triangles, and a change over the control socket may add at most"));
  CHECK(r.runtime.reconfigurator().present_scene()->rendering_id == 0);
}

}  // namespace
}  // namespace wrenchd::test_scene_cost
