// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "collision/meshes/make_mesh.hpp"
#include "config/load_scene.hpp"
#include "daemon/control/scene_geometry.hpp"
#include "tests/support/shipped_config.hpp"
#include "tools/view/view_scene.hpp"

namespace wrenchd::test_scene_geometry {

using namespace wrenchd::test;

namespace {

/// A cube above two gears, one of which moves, and a floor.
std::shared_ptr<const Scene> three_bodies() {
  const auto gear =
      std::make_shared<const MeshBvh>(make_mesh({.kind = "gear", .triangles = 2000, .seed = 1}));
  ObstacleMotion motion;
  motion.linear_m_per_s = {0.0, 0.02, 0.0};
  motion.reverse_after_s = 1.5;
  std::vector<MeshObstacle> meshes;
  meshes.emplace_back("still", gear, Pose{Quaterniond::Identity(), {0.1, 0.0, 0.0}});
  meshes.emplace_back("moving", gear, Pose{rotation_from({0.0, 0.3, 0.0}), {-0.1, 0.0, 0.0}}, motion);
  ToolBody tool = load_tool(shipped_config().scene.tool);
  return std::make_shared<const Scene>(std::move(tool),
                                       std::vector<HalfSpaceSettings>{{"floor", {0, 0, 1}, -0.1}},
                                       std::vector<ConvexObstacle>{}, std::move(meshes));
}

Json description_of(const SceneGeometry& geometry, const Scene& scene) {
  Json description = geometry.description(scene);
  description["geometry_id"] = 1;
  description["rendering_id"] = 0;
  description["scene_time_begins_ns"] = 5'000'000'000;
  description["X_WB"] = pose_json({});
  description["X_HT"] = pose_json({});
  description["wrench_about"] = "handle";
  return description;
}

}  // namespace

TEST_CASE("the geometry of a scene is in sealed memory", "[view]") {
  const auto scene = three_bodies();
  const SceneGeometry geometry(scene);
  const int fd = geometry.descriptor();
  CHECK(ftruncate(fd, 1) != 0);
  CHECK(write(fd, "x", 1) != 1);
  CHECK(mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0) == MAP_FAILED);
  void* const seen = mmap(nullptr, geometry.bytes().size(), PROT_READ, MAP_SHARED, fd, 0);
  REQUIRE(seen != MAP_FAILED);
  CHECK(std::memcmp(seen, geometry.bytes().data(), geometry.bytes().size()) == 0);
  munmap(seen, geometry.bytes().size());
}

TEST_CASE("the geometry contains a mesh once, even if several obstacles use it", "[view]") {
  const auto scene = three_bodies();
  const SceneGeometry geometry(scene);
  const Json described = geometry.description(*scene);
  REQUIRE(described["meshes"].size() == 2);
  REQUIRE(described["obstacles"].size() == 3);
  CHECK(described["obstacles"][0]["name"] == "floor");
  CHECK(described["obstacles"][0]["half_space"]["offset_m"] == -0.1);
  CHECK(described["obstacles"][1]["mesh"] == 1);
  CHECK(described["obstacles"][2]["mesh"] == 1);
  CHECK(described["obstacles"][2]["motion"]["reverse_after_s"] == 1.5);
  const Json& gear = described["meshes"][1];
  const TriangleMesh& mesh = scene->meshes()[0].mesh->surface.mesh();
  REQUIRE(gear["vertices"] == mesh.vertices_m.size());
  REQUIRE(gear["triangles"] == mesh.triangles.size());
  float x = 0.0F;
  std::uint32_t last = 0;
  std::memcpy(&x, geometry.bytes().data() + gear["vertices_offset"].get<std::size_t>() + 12 * 7 + 4, 4);
  CHECK(x == static_cast<float>(mesh.vertices_m[7].y()));
  std::memcpy(&last, geometry.bytes().data() + geometry.bytes().size() - 4, 4);
  CHECK(last == mesh.triangles.back()[2]);
}

TEST_CASE("geometry matches another scene of the same meshes, and no other scene", "[view]") {
  const auto scene = three_bodies();
  const SceneGeometry geometry(scene);
  std::vector<MeshObstacle> fewer = {scene->meshes()[1]};
  const Scene moved(scene->tool(), {}, {}, fewer);
  CHECK(geometry.matches(moved));
  const Json described = geometry.description(moved);
  REQUIRE(described["obstacles"].size() == 1);
  CHECK(described["obstacles"][0]["mesh"] == 1);
  CHECK_FALSE(geometry.matches(*three_bodies()));  // the same gear, loaded again
  ToolBody other = scene->tool();
  other.mesh.vertices_m[0].x() += 1e-3;
  CHECK_FALSE(geometry.matches(Scene(other, {}, {}, fewer)));
}

TEST_CASE("the view reads the scene of the daemon, and moves obstacles by scene time", "[view]") {
  const auto scene = three_bodies();
  const SceneGeometry geometry(scene);
  const ViewScene view(description_of(geometry, *scene), geometry.bytes());
  CHECK(view.meshes().size() == 2);
  CHECK(view.obstacle_name(2) == "moving");
  CHECK(view.obstacle_name(9) == "obstacle 9");
  const Json moved = view.moved_poses(5'000'000'000 + 2'000'000'000, {});  // at scene time 2 s
  REQUIRE(moved.size() == 1);
  CHECK(moved[0][0] == 2);
  const Pose X_WO = scene->meshes()[1].X_WO_at(2.0);
  CHECK(moved[0][1][1].get<double>() == Approx(X_WO.translation_m.y()));
  CHECK(std::abs(X_WO.translation_m.y()) > 0.005);
  const ViewScene again(description_of(geometry, *scene), {}, &view);  // the same geometry is not read again
  CHECK(again.meshes() == view.meshes());
  CHECK_THROWS_WITH(ViewScene(description_of(geometry, *scene), geometry.bytes().first(100)),
                    Catch::Contains("the geometry of the scene exceeds its memory"));
  Json broken = description_of(geometry, *scene);
  broken.erase("tool");
  CHECK_THROWS_WITH(ViewScene(broken, geometry.bytes()),
                    Catch::Contains("the scene has an unknown format: "));
}

}  // namespace wrenchd::test_scene_geometry
