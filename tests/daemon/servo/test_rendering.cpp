// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_placement.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "daemon/servo/rendering.hpp"
#include "tests/support/gallery_run.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_rendering {

using namespace test;

namespace {

constexpr double kTick_s = 1e-3;

ToolBody box(double side_m, double mass_kg) {
  return tool_body(make_mesh({"box", 12, 1, Vector3d::Constant(side_m)}), 1.0, mass_kg);
}

/// A plate whose top is at z = 0, a wall of 40 mm at x = -100 mm, and a tool of 20 mm.
Scene plate() {
  std::vector<MeshObstacle> obstacles;
  obstacles.emplace_back("wall", MeshBvh(make_mesh({"box", 12, 1, {0.004, 0.6, 0.04}})),
                         Pose{Quaterniond::Identity(), {-0.1, 0.0, 0.0201}});
  obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.6, 0.6, 0.02}})),
                         Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}});
  return {box(0.02, 0.2), {}, {}, std::move(obstacles)};
}

/// The same with a crate of 50 mm at x = 150 mm; z_m: height of its centre.
Scene plate_with_crate(double z_m = 0.025) {
  const Scene scene = plate();
  FreeBody crate;
  crate.name = "crate";
  crate.body = box(0.05, 0.3);
  crate.motion.X_WB.translation_m = {0.15, 0.0, z_m};
  crate.friction = 0.5;
  crate.mesh = std::make_shared<const MeshBvh>(crate.body.mesh, crate.body.kind);
  MeshLoader loader;
  return {scene, placed({crate}, scene, loader), {0.0, 0.0, -9.81}};
}

/// A rendering that a hand leads, tick by tick.
class Led {
 public:
  explicit Led(Scene scene)
      : scene_(std::make_shared<const Scene>(std::move(scene))),
        rendering(0, config_.settings, config_.profile, scene_,
                  make_proxy_initializer(scene_, ProxySearchMode::in_tick)) {}

  /// One tick with the commanded pose of the tool at x_m, z_m.
  void to(double x_m, double z_m) {
    ++tick_;
    const double time_s = kTick_s * static_cast<double>(tick_);
    REQUIRE(rendering.project(hand(x_m, z_m), TimePoint{} + from_seconds(time_s), time_s));
    rendering.compute_wrench(kTick_s);
  }
  void rest_at(double x_m, double z_m, int ticks) {
    for (int k = 0; k < ticks; ++k) to(x_m, z_m);
  }
  Pose hand(double x_m, double z_m) const {
    Pose X_WP;
    X_WP.translation_m = {x_m, 0.0, z_m};
    return X_WP * inverse(rendering.X_HT());
  }
  Vector3d position_m() const { return rendering.X_WQ().translation_m; }

 private:
  RunConfig config_ = gallery_config("push_the_box");
  std::shared_ptr<const Scene> scene_;
  std::uint64_t tick_ = 0;

 public:
  Rendering rendering;
};

/// True if no corner of one cube is in the other: the tool of 20 mm and the crate of 50 mm.
bool are_apart(const Led& led) {
  constexpr double kTool_m = 0.01, kCrate_m = 0.025;
  const Pose& X_WT = led.rendering.X_WQ();
  const Pose X_WC = led.rendering.X_WB()[0];
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d sign(corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0);
    const Vector3d tool_C_m = inverse(X_WC) * (X_WT * Vector3d(kTool_m * sign));
    const Vector3d crate_T_m = inverse(X_WT) * (X_WC * Vector3d(kCrate_m * sign));
    if (tool_C_m.lpNorm<Eigen::Infinity>() < kCrate_m || crate_T_m.lpNorm<Eigen::Infinity>() < kTool_m)
      return false;
  }
  return true;
}

/// Ticks after which the crate sleeps.
constexpr int kAsleep = 300;

TEST_CASE("bodies that sleep out of reach leave the proxy as it is without them", "[rendering]") {
  Led with(plate_with_crate()), without(plate());
  for (Led* led : {&with, &without}) led->rest_at(-0.05, 0.04, kAsleep);
  for (int k = 0; k < 800; ++k) {
    const double x_m = -0.05 + 0.05 * kTick_s * k, z_m = 0.04 - 0.04 * std::min(1.0, kTick_s * 2 * k);
    for (Led* led : {&with, &without}) led->to(x_m, z_m);
    INFO("tick " << k);
    CHECK(same_bits(with.rendering.X_WQ(), without.rendering.X_WQ()));
    CHECK(with.rendering.F_T().force_N == without.rendering.F_T().force_N);
    CHECK(with.rendering.contacts().size() == without.rendering.contacts().size());
  }
  CHECK(without.rendering.in_contact());
}

TEST_CASE("a tool that followed alone meets the sleeping body, and wakes it without a jump", "[rendering]") {
  Led led(plate_with_crate());
  led.rest_at(0.0, 0.04, kAsleep);
  led.rest_at(0.0, 0.005, 100);  // pressed on the plate
  REQUIRE(led.rendering.in_contact());
  const Vector3d start_m = led.rendering.X_WB()[0].translation_m;
  constexpr double kSpeed_m_per_s = 0.1;
  for (int k = 0; k < 2000; ++k) {
    const Vector3d before_m = led.position_m();
    const Vector3d force_before_N = led.rendering.F_T().force_N;
    led.to(kSpeed_m_per_s * kTick_s * k, 0.005);
    INFO("tick " << k);
    const double gap_m = led.rendering.X_WB()[0].translation_m.x() - 0.025 - (led.position_m().x() + 0.01);
    CHECK(gap_m > 0.0);
    CHECK((led.position_m() - before_m).norm() < 3.0 * kSpeed_m_per_s * kTick_s);
    CHECK((led.rendering.F_T().force_N - force_before_N).norm() < 0.2);
  }
  CHECK(led.rendering.X_WB()[0].translation_m.x() - start_m.x() > 0.03);
  // Back to where the crate is out of reach, until it sleeps again.
  for (int k = 0; k < 1000; ++k) led.to(0.2 - 0.25 * kTick_s * k, 0.03);
  const Vector3d left_m = led.rendering.X_WB()[0].translation_m;
  led.rest_at(-0.05, 0.005, 500);
  CHECK(led.rendering.in_contact());
  CHECK(led.rendering.X_WB()[0].translation_m == left_m);
}

TEST_CASE("a body that is out of reach and not at rest moves on", "[rendering]") {
  Led led(plate_with_crate(0.1));
  led.rest_at(-0.05, 0.04, 400);
  CHECK(led.rendering.X_WB()[0].translation_m.z() == Approx(0.025).margin(1e-6));
}

TEST_CASE("a tick after many in which the tool followed alone is undone from where the tool is",
          "[rendering]") {
  Led led(plate_with_crate());
  led.rest_at(-0.05, 0.07, kAsleep);
  for (int k = 0; k < 200; ++k) led.to(-0.05 - 0.0005 * k, 0.07);  // over the wall
  led.rest_at(-0.15, 0.02, 100);
  REQUIRE(led.position_m().x() == Approx(-0.15).margin(1e-6));
  CHECK(led.rendering.move(led.hand(0.3, 0.02)));  // towards the crate, behind the wall
  CHECK(led.position_m().x() < -0.11);
  led.rendering.undo_move();
  CHECK(led.position_m().x() == Approx(-0.15).margin(1e-6));
}

TEST_CASE("a tick in which the tool followed alone can be moved and undone", "[rendering]") {
  Led led(plate_with_crate());
  led.rest_at(0.0, 0.04, kAsleep);
  led.rest_at(0.0, 0.005, 100);
  const Vector3d tool_m = led.position_m();
  const Vector3d crate_m = led.rendering.X_WB()[0].translation_m;
  SECTION("a little") {
    CHECK(led.rendering.move(led.hand(0.001, 0.005)));
    CHECK(led.position_m().x() == Approx(0.001).margin(1e-9));
  }
  SECTION("into the crate, and past it") {
    CHECK(led.rendering.move(led.hand(0.3, 0.005)));
    CHECK(led.position_m().x() < led.rendering.X_WB()[0].translation_m.x());  // not past it
    CHECK(are_apart(led));
  }
  led.rendering.undo_move();
  CHECK((led.position_m() - tool_m).norm() < 1e-8);
  CHECK((led.rendering.X_WB()[0].translation_m - crate_m).norm() < 1e-8);
}

TEST_CASE("following alone and among bodies does not allocate", "[rendering]") {
  Led led(plate_with_crate());
  led.rest_at(0.0, 0.04, kAsleep);
  const RealtimeGuard guard;
  for (int k = 0; k < 1500; ++k) {
    led.to(0.1 * kTick_s * k, 0.005);
    led.rendering.move(led.hand(0.1 * kTick_s * k, 0.004));
    led.rendering.undo_move();
  }
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace wrenchd::test_rendering
