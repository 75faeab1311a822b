// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <memory>
#include <thread>

#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "tests/support/buried_tool.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// Of 50 mm.
ToolBody cube() {
  return tool_body(make_mesh({"cube", 12}), 1.0, 0.1);
}

/// The cube, and a boulder around the origin.
Scene cube_and_boulder(std::size_t triangles, std::vector<HalfSpaceSettings> walls = {}) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"boulder", MeshBvh(make_mesh({"boulder", triangles})), Pose{}});
  return Scene(cube(), std::move(walls), {}, std::move(obstacles));
}

const Pose kDeep = {rotation_from({0.1, 0.2, 0.3}), {0.01, 0.02, 0.03}};

ProxyInitializationResult awaited(ProxyInitializer& placer) {
  ProxyInitializationResult answer;
  while (!placer.take_result(answer)) std::this_thread::sleep_for(1ms);
  return answer;
}

TEST_CASE("the answer is admissible, and the same on a thread and in step", "[placer]") {
  const Scene scene = cube_and_boulder(2000);
  BackgroundProxyInitializer thread(scene);
  InTickProxyInitializer step(scene);
  for (ProxyInitializer* placer :
       {static_cast<ProxyInitializer*>(&thread), static_cast<ProxyInitializer*>(&step)}) {
    ProxyInitializationResult answer;
    CHECK_FALSE(placer->take_result(answer));  // nothing was asked
    placer->request({7, kDeep, 1.25});
    answer = awaited(*placer);
    CHECK(answer.id == 7);
    CHECK(answer.scene_time_s == 1.25);
    REQUIRE(answer.found);
    CHECK(FeasiblePoseSearch(scene).admissible(answer.X_WQ));
    CHECK((answer.X_WQ.translation_m - kDeep.translation_m).norm() > 0.01);
    CHECK_FALSE(placer->take_result(answer));  // once
  }
  thread.request({8, kDeep});
  step.request({8, kDeep});
  const ProxyInitializationResult a = awaited(thread), b = awaited(step);
  CHECK(a.X_WQ.translation_m == b.X_WQ.translation_m);
  CHECK(a.X_WQ.rotation.coeffs() == b.X_WQ.rotation.coeffs());
}

TEST_CASE("a pose that is admissible is its own answer, whatever the scene is of", "[placer]") {
  const Pose X_WP = {rotation_from({0.1, 0.2, 0.3}), {0, 0, 0.2}};
  const Scene boulder = cube_and_boulder(500);
  const Scene table(cube(), {{"table", Vector3d::UnitZ(), 0.0}});
  for (const Scene* scene : {&boulder, &table}) {
    InTickProxyInitializer placer(*scene);
    placer.request({1, X_WP});
    const ProxyInitializationResult answer = awaited(placer);
    REQUIRE(answer.found);
    CHECK((answer.X_WQ.translation_m - X_WP.translation_m).norm() < 1e-12);
  }
}

TEST_CASE("of several questions the newest is answered last", "[placer]") {
  const Scene scene = cube_and_boulder(500);
  BackgroundProxyInitializer placer(scene);
  for (std::uint32_t number = 1; number <= 5; ++number) placer.request({number, kDeep});
  ProxyInitializationResult answer;
  do answer = awaited(placer);
  while (answer.id != 5);
  CHECK(answer.found);
}

TEST_CASE("where the tool does not fit the answer is that there is no place", "[placer]") {
  const bool boulder = GENERATE(false, true);
  const auto walls = closed_box(0.02);  // the cube's half edge is 25 mm
  const Scene scene = boulder ? cube_and_boulder(100, walls) : Scene(cube(), walls);
  BackgroundProxyInitializer placer(scene);
  placer.request({1, Pose{}});
  CHECK_FALSE(awaited(placer).found);
}

TEST_CASE("a search that is told to stop ends, and a placer with one under way is joined at once",
          "[placer]") {
  // A tenth of a million triangles, and a thousand poses to look at before one is free.
  const Scene scene = cube_and_boulder(100000);
  std::stop_source stop;
  stop.request_stop();
  const auto start = std::chrono::steady_clock::now();
  CHECK(FeasiblePoseSearch(scene).nearest(kDeep, stop.get_token()).status == ProjectionStatus::infeasible);
  auto placer = std::make_unique<BackgroundProxyInitializer>(scene);
  placer->request({1, kDeep});
  std::this_thread::sleep_for(50ms);
  ProxyInitializationResult answer;
  CHECK_FALSE(placer->take_result(answer));
  placer.reset();
  CHECK(std::chrono::steady_clock::now() - start <
        1s);  // milliseconds, on a machine that has nothing else to do
}

TEST_CASE("to ask and to look for the answer neither allocates nor locks", "[placer][realtime]") {
  const Scene scene = cube_and_boulder(500);
  BackgroundProxyInitializer placer(scene);
  ProxyInitializationResult answer;
  std::uint64_t allocations = 0, locks = 0;
  for (std::uint32_t number = 1; number <= 3; ++number) {
    bool answered = false;
    while (!answered) {
      const RealtimeGuard guard;
      if (answer.id + 1 == number) placer.request({number, kDeep});
      answered = placer.take_result(answer) && answer.id == number;
      allocations += guard.allocations();
      locks += guard.locks();
    }
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("where the proxy stands has a name", "[placer]") {
  CHECK(std::string(name(ProxyInitialization::complete)) == "following");
  CHECK(std::string(name(ProxyInitialization::searching)) == "placing");
  CHECK(std::string(name(ProxyInitialization::found)) == "placed");
  CHECK(std::string(name(ProxyInitialization::failed)) == "no place");
}

}  // namespace
}  // namespace wrenchd
