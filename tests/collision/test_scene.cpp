// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/mesh_file.hpp"
#include "collision/scene.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/separation.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_scene {

namespace {

using namespace test;

SceneSettings box_above_floor(const TemporaryDirectory& dir) {
  SceneSettings settings;
  settings.tool.mesh = dir.write("box.off", as_off(box({0, 0, 0}, {2, 2, 2})));
  settings.tool.scale = 0.5;
  settings.half_spaces = {{"floor", Vector3d::UnitZ(), 0.0}};
  return settings;
}

TEST_CASE("a scene is built from its settings, and rejects an invalid mesh") {
  const TemporaryDirectory dir;
  SceneSettings settings = box_above_floor(dir);
  const Scene scene(settings);
  // X_WT is the pose of the centre of mass: half the side is 0.5 m.
  CHECK(separation_m(scene, {Quaterniond::Identity(), {0, 0, 2}}) == Approx(1.5));
  CHECK(scene.tool_radius_m() == Approx(std::sqrt(0.75)));
  settings.tool.mesh = dir.path() / "none.off";
  CHECK_THROWS_AS(Scene(settings), MeshError);
}

TEST_CASE("a mesh obstacle has its pose and scale") {
  const TemporaryDirectory dir;
  SceneSettings settings = box_above_floor(dir);
  settings.half_spaces.clear();
  MeshObstacleSettings post;
  post.name = "post";
  post.mesh = dir.write("post.off", as_off(box({0, 0, 0}, {1, 1, 10})));
  post.scale = 0.1;
  post.X_WM = {rotation_from(Vector3d(0, 0, 1.5707963267948966)), {0, 0, 3}};  // x becomes y, y becomes -x
  settings.meshes = {post};
  const Scene scene(settings);
  REQUIRE(scene.convex().size() == 1);
  CHECK(scene.convex()[0].name == "post");
  CHECK((scene.convex()[0].centre_W_m - Vector3d(-0.05, 0.05, 3.5)).norm() < 1e-12);
  CHECK(separation_m(scene, {Quaterniond::Identity(), {1.0, 0, 3.5}}) == Approx(0.5));
  CHECK(separation_m(scene, {Quaterniond::Identity(), {0, 0, 2}}) == Approx(0.5));
}

TEST_CASE("convex bodies are held as such, all others as meshes only", "[scene]") {
  const TemporaryDirectory dir;
  SceneSettings settings = box_above_floor(dir);
  // A box with a notch in its top: the middle of the upper face is lowered.
  const auto notched = dir.write("notched.off",
                                 "OFF\n9 14 0\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n0 0 2\n2 0 2\n2 2 2\n0 2 2\n"
                                 "1 1 1\n3 0 2 1\n3 0 3 2\n3 0 1 5\n3 0 5 4\n3 1 2 6\n3 1 6 5\n3 2 3 7\n"
                                 "3 2 7 6\n3 3 0 4\n3 3 4 7\n3 4 5 8\n3 5 6 8\n3 6 7 8\n3 7 4 8\n");
  CHECK(Scene(settings).tool_mesh() == nullptr);  // half-spaces use the hull only
  MeshObstacleSettings post;
  post.name = "post";
  post.mesh = settings.tool.mesh;
  settings.meshes = {post};
  const auto forms = [&] {
    const Scene scene(settings);
    CHECK(scene.obstacle_count() == 2);
    REQUIRE(scene.tool_mesh() != nullptr);
    return std::pair(scene.convex().size(), scene.meshes().size());
  };
  CHECK(forms() == std::pair<std::size_t, std::size_t>(1, 1));
  settings.meshes[0].mesh = notched;
  CHECK(forms() == std::pair<std::size_t, std::size_t>(0, 1));
  settings.meshes[0].mesh = settings.tool.mesh;
  settings.tool.mesh = notched;
  CHECK(forms() == std::pair<std::size_t, std::size_t>(0, 1));
}

TEST_CASE("a moving obstacle follows its motion, and disables the convex bodies", "[scene]") {
  const TemporaryDirectory dir;
  SceneSettings settings = box_above_floor(dir);
  MeshObstacleSettings post;
  post.name = "post";
  post.mesh = settings.tool.mesh;
  post.X_WM = {rotation_from({0.1, 0.2, 0.3}), {0, 0, 3}};
  settings.meshes = {post, post};
  const Scene still(settings);
  CHECK_FALSE(still.has_moving_obstacles());
  CHECK(still.convex().size() == 2);
  CHECK(still.meshes()[1].X_WO_at(5.0).translation_m == post.X_WM.translation_m);
  settings.meshes[1].motion = {{0.1, 0, 0}, {0, 0, 1.0}, 2.0};
  const Scene scene(settings);
  CHECK(scene.has_moving_obstacles());
  CHECK(scene.convex().empty());
  REQUIRE(scene.meshes().size() == 2);
  CHECK(scene.obstacle_count() == 3);
  const MeshObstacle& moving = scene.meshes()[1];
  CHECK(moving.mesh == scene.meshes()[0].mesh);  // the mesh is shared
  CHECK(moving.X_WO_at(0.0).translation_m == post.X_WM.translation_m);
  CHECK(moving.X_WO_at(0.0).rotation.coeffs() == post.X_WM.rotation.coeffs());
  CHECK((moving.X_WO_at(3.0).translation_m - Vector3d(0.1, 0, 3)).norm() < 1e-15);  // on its return
  CHECK(moving.X_WO_at(3.0).rotation.angularDistance(rotation_from({0, 0, 1}) * post.X_WM.rotation) < 1e-15);
  CHECK((moving.centre_O_m - Vector3d(1, 1, 1)).norm() < 1e-15);
  CHECK((moving.X_WO_at(0.0) * moving.centre_O_m - moving.centre_W_m).norm() == 0.0);

  // The same holds for a scene built in code.
  std::vector<MeshObstacle> meshes = still.meshes();
  meshes[0].motion.linear_m_per_s = {0, 0, 1};
  const Scene by_hand(still.tool(), {}, still.convex(), std::move(meshes));
  CHECK(by_hand.has_moving_obstacles());
  CHECK(by_hand.convex().empty());
}

TEST_CASE("a scene with new poses shares its meshes, and scheduled motions apply", "[scene][moving]") {
  const TemporaryDirectory dir;
  SceneSettings settings = box_above_floor(dir);
  MeshObstacleSettings post;
  post.name = "post";
  post.mesh = settings.tool.mesh;
  settings.meshes = {post, post};
  const Scene first(settings);
  CHECK_FALSE(first.has_moving_obstacles());
  settings.meshes[0].X_WM.translation_m = {0, 0, 3};
  settings.meshes[1].scheduled = {
      5.0, {Quaterniond::Identity(), {1, 0, 0}}, {{0.1, 0, 0}, {0, 0, 0}, 0.0, 5.0, 2.0}};
  const Scene second(first, settings.meshes);
  CHECK(second.has_moving_obstacles());
  CHECK(second.meshes()[0].mesh == first.meshes()[0].mesh);
  CHECK(second.tool_mesh() == first.tool_mesh());
  CHECK(second.meshes()[0].X_WO_at(1.0).translation_m == Vector3d(0, 0, 3));
  CHECK((second.meshes()[0].centre_W_m - Vector3d(1, 1, 4)).norm() < 1e-15);
  const MeshObstacle& moved = second.meshes()[1];
  CHECK(moved.X_WO_at(4.9).translation_m == Vector3d::Zero());
  CHECK((moved.X_WO_at(6.0).translation_m - Vector3d(1.1, 0, 0)).norm() < 1e-15);
  CHECK((moved.X_WO_at(60.0).translation_m - Vector3d(1.2, 0, 0)).norm() < 1e-15);
  CHECK((second.obstacle_displacement(second.first_mesh() + 1, 5.5, 6.5).translation_m - Vector3d(0.1, 0, 0))
            .norm() < 1e-15);
}

}  // namespace
}  // namespace wrenchd::test_scene
