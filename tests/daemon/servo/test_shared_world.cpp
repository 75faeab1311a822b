// SPDX-License-Identifier: GPL-3.0-or-later
// Two hands whose tools and bodies share one world: the gallery scene carry_the_plate in virtual time.
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/two_hands.hpp"

namespace wrenchd::test_shared_world {

using namespace test;

namespace {

constexpr double kPlateWeight_N = 0.25 * 9.81;

/// The right hand and the left one, armed.
struct PlateRun : TwoHands {
  PlateRun() : TwoHands(gallery("carry_the_plate")) { arm(); }

  /// Force on a hand in the world [N]: the bases are parallel to it.
  Vector3d force_N(std::size_t i) const { return {last[i].F_out[0], last[i].F_out[1], last[i].F_out[2]}; }
  Vector3d tool_m(std::size_t i) const { return {last[i].X_WQ[0], last[i].X_WQ[1], last[i].X_WQ[2]}; }
  Vector3d plate_m() const { return {last[0].X_WB[0], last[0].X_WB[1], last[0].X_WB[2]}; }
  std::size_t held(std::size_t i) const { return hands[i]->loop().held_body(); }
};

}  // namespace

TEST_CASE("two simulated hands carry a plate, and one hands it to the other", "[shared_world]") {
  PlateRun h;
  h.run_until(5.5);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(h.hands[i]->state() == State::active);
    CHECK(h.held(i) == 1);
    CHECK(h.force_N(i).z() == Approx(-0.5 * kPlateWeight_N).epsilon(0.1));
  }
  CHECK(h.plate_m().z() > 0.05);
  CHECK(h.plate_m().y() > 0.03);
  // Each hand sees the other tool as the body after the plate.
  const auto other_m = [&](std::size_t i) {
    return Vector3d(h.last[i].X_WB[7], h.last[i].X_WB[8], h.last[i].X_WB[9]);
  };
  CHECK((other_m(0) - h.tool_m(1)).norm() < 1e-3);
  CHECK((other_m(1) - h.tool_m(0)).norm() < 1e-3);
  double largest_change_N = 0.0;
  Vector3d before_N = h.force_N(0);
  while (h.clock.now() < TimePoint{} + from_seconds(9.0)) {
    h.step();
    largest_change_N = std::max(largest_change_N, (h.force_N(0) - before_N).norm());
    before_N = h.force_N(0);
  }
  CHECK(h.held(0) == 1);
  CHECK(h.held(1) == 0);
  CHECK(h.force_N(0).z() == Approx(-kPlateWeight_N).epsilon(0.1));
  CHECK(h.force_N(1).norm() < 1e-9);
  CHECK(largest_change_N < 0.1);
  h.run_until(12.2);
  CHECK(h.held(0) == 0);
  CHECK(h.plate_m().z() == Approx(0.006).margin(1e-4));
  for (SimulatedHand* hand : h.hands) CHECK(hand->state() == State::active);
}

TEST_CASE("a fault of one hand releases both while they hold the same body, and only one otherwise",
          "[shared_world]") {
  const bool together = GENERATE(true, false);
  PlateRun h;
  h.run_until(together ? 5.0 : 1.8);
  REQUIRE(h.held(0) == (together ? 1U : 0U));
  h.hands[1]->loop().requests().stop();
  h.step();
  h.step();
  h.step();
  h.step();
  CHECK(h.hands[1]->state() == State::stopped);
  CHECK(h.force_N(1).norm() == 0.0);
  if (together) {
    CHECK(h.hands[0]->state() == State::fault);
    CHECK(h.last[0].state_cause == Fault::other_hand_released);
    CHECK(h.force_N(0).norm() == 0.0);
  } else {
    CHECK(h.hands[0]->state() == State::active);
  }
}

TEST_CASE("a hand whose device is lost leaves the world, and the other one goes on", "[shared_world]") {
  PlateRun h;
  h.run_until(1.8);
  h.second.device.inject(
      {SimulatedFault::Kind::unplug, h.clock.now() - TimePoint{}, std::chrono::milliseconds(100)});
  h.run_until(2.0);
  CHECK_FALSE(h.loops.attached(1));
  CHECK(h.hands[0]->state() == State::active);
  CHECK_FALSE(h.scenes[0].tool.world->world().has_hand(1));
  CHECK(h.last[0].X_WB[9] == -SharedWorld::kFarBelow_m);
  h.run_until(3.0);
  CHECK(h.held(0) == 1);  // it takes the plate alone
}

TEST_CASE("a body falls by the clock, also if the second hand comes later", "[shared_world]") {
  const bool later = GENERATE(false, true);
  std::vector<RunConfig> configs = TwoHands::gallery("carry_the_plate");
  for (RunConfig& config : configs) config.scene.bodies[0].X_WM.translation_m.z() = 0.6;
  TwoHands h(configs, !later);
  const BodyWorld& world = h.scenes[0].tool.world->world();
  h.run_until(0.1);
  if (later) h.loops.attach(1, h.hands[1]->loop());
  h.run_until(0.25);
  // The first step takes a millisecond, the first tick is after one.
  CHECK(0.6 - world.motion(1).X_WB.translation_m.z() == Approx(0.5 * 9.81 * 0.25 * 0.25).epsilon(0.01));
  CHECK(world.motion(1).velocity_W_m_per_s.z() == Approx(-9.81 * 0.25).epsilon(0.005));
  CHECK(world.time_s() == Approx(0.249).margin(1e-3));
}

TEST_CASE("two hands are deterministic", "[shared_world]") {
  PlateRun a, b;
  a.run_until(3.5);
  b.run_until(3.5);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(a.last[i].X_WQ == b.last[i].X_WQ);
    CHECK(a.last[i].F_out == b.last[i].F_out);
  }
}

}  // namespace wrenchd::test_shared_world
