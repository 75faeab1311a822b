// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/hand_scenes.hpp"
#include "tests/support/two_hands.hpp"

namespace wrenchd::test_hand_scenes {

using namespace test;

using Catch::Contains;

TEST_CASE("each hand sees the free bodies, and the tool of the other hand as the last body",
          "[hand_scenes]") {
  const std::vector<RunConfig> configs = TwoHands::gallery("carry_the_plate");
  MeshLoader meshes;
  const auto scenes = make_hand_scenes(configs[0], configs[1], meshes);
  for (const HandScene& one : scenes) {
    REQUIRE(one.scene->bodies().size() == 2);
    CHECK(one.scene->bodies()[0].name == "plate");
    CHECK_FALSE(one.scene->bodies()[0].of_hand);
    CHECK(one.scene->bodies()[1].of_hand);
    CHECK(one.scene->bodies()[1].motion.X_WB.translation_m.z() == -SharedWorld::kFarBelow_m);
  }
  CHECK(scenes[0].tool.world == scenes[1].tool.world);
  CHECK(scenes[0].tool.tool == 0);
  CHECK(scenes[1].tool.tool == 1);
  // Nobody has entered the world yet.
  const SharedWorld& shared = *scenes[0].tool.world;
  CHECK(shared.poses_without(0)[1].translation_m.z() == -SharedWorld::kFarBelow_m);
  CHECK_FALSE(shared.world().has_hand(0));
}

TEST_CASE("with two hands a scene has at most seven free bodies", "[hand_scenes]") {
  std::vector<RunConfig> configs = TwoHands::gallery("carry_the_plate");
  for (RunConfig& config : configs)
    while (config.scene.bodies.size() < SceneSettings::kMaxBodies) {
      BodySettings next = config.scene.bodies.back();
      next.X_WM.translation_m.z() += 0.02;
      config.scene.bodies.push_back(next);
    }
  MeshLoader meshes;
  CHECK_THROWS_WITH(make_hand_scenes(configs[0], configs[1], meshes),
                    Contains("carry_the_plate.toml") && Contains("at most 7 [[body]] tables"));
  for (RunConfig& config : configs) config.scene.bodies.pop_back();
  CHECK_NOTHROW(make_hand_scenes(configs[0], configs[1], meshes));
}

TEST_CASE("two hands need the exact method, and the message says so", "[hand_scenes]") {
  std::vector<RunConfig> configs = TwoHands::gallery("carry_the_plate");
  configs[0].settings.rendering.method = Method::planar;
  CHECK_THROWS_WITH(TwoHands(configs), Contains("two hands act in the scene") && Contains("[[hand]]"));
}

}  // namespace wrenchd::test_hand_scenes
