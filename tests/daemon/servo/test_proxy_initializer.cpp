// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <memory>
#include <thread>

#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "tests/support/buried_tool.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_proxy_initializer {

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

ProxyInitializationResult wait_for_result(ProxyInitializer& initializer) {
  ProxyInitializationResult result;
  while (!initializer.take_result(result)) std::this_thread::sleep_for(1ms);
  return result;
}

TEST_CASE("the result is feasible, and equal in a background thread and in a tick", "[proxy_initializer]") {
  const Scene scene = cube_and_boulder(2000);
  BackgroundProxyInitializer thread(scene);
  InTickProxyInitializer step(scene);
  for (ProxyInitializer* initializer :
       {static_cast<ProxyInitializer*>(&thread), static_cast<ProxyInitializer*>(&step)}) {
    ProxyInitializationResult result;
    CHECK_FALSE(initializer->take_result(result));  // no request yet
    initializer->request({7, kDeep, 1.25});
    result = wait_for_result(*initializer);
    CHECK(result.id == 7);
    CHECK(result.scene_time_s == 1.25);
    REQUIRE(result.found);
    CHECK(FeasiblePoseSearch(scene).admissible(result.X_WQ));
    CHECK((result.X_WQ.translation_m - kDeep.translation_m).norm() > 0.01);
    CHECK_FALSE(initializer->take_result(result));  // each result is taken once
  }
  thread.request({8, kDeep});
  step.request({8, kDeep});
  const ProxyInitializationResult a = wait_for_result(thread), b = wait_for_result(step);
  CHECK(a.X_WQ.translation_m == b.X_WQ.translation_m);
  CHECK(a.X_WQ.rotation.coeffs() == b.X_WQ.rotation.coeffs());
}

TEST_CASE("a feasible pose is its own result, among meshes and among half-spaces", "[proxy_initializer]") {
  const Pose X_WP = {rotation_from({0.1, 0.2, 0.3}), {0, 0, 0.2}};
  const Scene boulder = cube_and_boulder(500);
  const Scene table(cube(), {{"table", Vector3d::UnitZ(), 0.0}});
  for (const Scene* scene : {&boulder, &table}) {
    InTickProxyInitializer initializer(*scene);
    initializer.request({1, X_WP});
    const ProxyInitializationResult result = wait_for_result(initializer);
    REQUIRE(result.found);
    CHECK((result.X_WQ.translation_m - X_WP.translation_m).norm() < 1e-12);
  }
}

TEST_CASE("of several requests the newest is answered last", "[proxy_initializer]") {
  const Scene scene = cube_and_boulder(500);
  BackgroundProxyInitializer initializer(scene);
  for (std::uint32_t id = 1; id <= 5; ++id) initializer.request({id, kDeep});
  ProxyInitializationResult result;
  do result = wait_for_result(initializer);
  while (result.id != 5);
  CHECK(result.found);
}

TEST_CASE("if the tool does not fit, no feasible pose is found", "[proxy_initializer]") {
  const bool boulder = GENERATE(false, true);
  const auto walls = closed_box(0.02);  // half the edge of the cube is 25 mm
  const Scene scene = boulder ? cube_and_boulder(100, walls) : Scene(cube(), walls);
  BackgroundProxyInitializer initializer(scene);
  initializer.request({1, Pose{}});
  CHECK_FALSE(wait_for_result(initializer).found);
}

TEST_CASE("a stopped search ends, and the destructor joins a running search at once", "[proxy_initializer]") {
  // 100 000 triangles; about 1000 poses are checked before a free one is found.
  const Scene scene = cube_and_boulder(100000);
  std::stop_source stop;
  stop.request_stop();
  const auto start = std::chrono::steady_clock::now();
  CHECK(FeasiblePoseSearch(scene).nearest(kDeep, stop.get_token()).status == ProjectionStatus::infeasible);
  auto initializer = std::make_unique<BackgroundProxyInitializer>(scene);
  initializer->request({1, kDeep});
  std::this_thread::sleep_for(50ms);
  ProxyInitializationResult result;
  CHECK_FALSE(initializer->take_result(result));
  initializer.reset();
  CHECK(std::chrono::steady_clock::now() - start < 1s);  // a few milliseconds on an idle machine
}

TEST_CASE("requesting and taking a result neither allocate nor lock", "[proxy_initializer][realtime]") {
  const Scene scene = cube_and_boulder(500);
  BackgroundProxyInitializer initializer(scene);
  ProxyInitializationResult result;
  std::uint64_t allocations = 0, locks = 0;
  for (std::uint32_t id = 1; id <= 3; ++id) {
    bool answered = false;
    while (!answered) {
      const RealtimeGuard guard;
      if (result.id + 1 == id) initializer.request({id, kDeep});
      answered = initializer.take_result(result) && result.id == id;
      allocations += guard.allocations();
      locks += guard.locks();
    }
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("each progress value has a name", "[proxy_initializer]") {
  CHECK(std::string(name(ProxyInitialization::complete)) == "complete");
  CHECK(std::string(name(ProxyInitialization::searching)) == "searching");
  CHECK(std::string(name(ProxyInitialization::found)) == "found");
  CHECK(std::string(name(ProxyInitialization::failed)) == "failed");
}

}  // namespace
}  // namespace wrenchd::test_proxy_initializer
