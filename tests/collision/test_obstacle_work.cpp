// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "collision/obstacle_work.hpp"
#include "collision/penetration.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_obstacle_work {

// The work of moving obstacles on the spring is the rise of T while the hand is at rest.

namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

Scene over_a_block(const ObstacleMotion& motion, const Pose& X_WO) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"block", MeshBvh(make_mesh({"cube", 12, 1})), X_WO, motion});
  return Scene(mesh_tool(make_mesh({"cube", 12, 1})), {}, {}, std::move(obstacles));
}

struct Sums {
  double most_T = 0.0, last_T = 0.0;
  double worst = 0.0;  ///< difference between T and the sum
  double sum = 0.0;
};

/// A hand at rest at p for this time, from an admissible pose.
Sums hold_still(const Scene& scene, const Pose& X_WP, double for_s) {
  PenetrationDepth depth(scene, {});
  Pose X_WQ = X_WP;
  depth.clear_history(0.0);
  Sums sums;
  Penetration now;
  for (double t = kTick_s; t < for_s; t += kTick_s) {
    sums.sum += 0.5 * obstacle_work(now.projection, scene, t - kTick_s, t);
    now = depth.follow(X_WP, X_WQ, t);
    X_WQ = now.projection.X_WQ;
    sums.sum += 0.5 * obstacle_work(now.projection, scene, t - kTick_s, t);
    sums.last_T = now.projection.energy;
    sums.most_T = std::max(sums.most_T, sums.last_T);
    sums.worst = std::max(sums.worst, std::abs(sums.sum - sums.last_T));
  }
  return sums;
}

TEST_CASE("the work of a rising block equals the rise of T, and its descent returns it", "[obstacle_work]") {
  ObstacleMotion motion;
  motion.linear_m_per_s = {0.0, 0.0, 0.04};
  motion.reverse_after_s = 0.2;
  const Pose X_WO{Quaterniond::Identity(), {0.012, 0.004, -0.054}};  // meets the cube's face off its centre
  const Scene scene = over_a_block(motion, X_WO);
  const Sums there = hold_still(scene, Pose{}, 0.2);
  CHECK(there.last_T > 1e-6);
  CHECK(there.worst < 0.01 * there.most_T);
  const Sums and_back = hold_still(scene, Pose{}, 0.4);
  CHECK(and_back.most_T >= there.most_T);
  CHECK(and_back.last_T == 0.0);
  CHECK(std::abs(and_back.sum) < 0.01 * there.most_T);
}

TEST_CASE("a rotating block does work in proportion to its lever", "[obstacle_work]") {
  ObstacleMotion motion;
  motion.angular_rad_per_s = {0.0, 2.0, 0.0};
  motion.reverse_after_s = 0.15;
  const Pose X_WO{Quaterniond::Identity(), {0.03, 0.0, -0.0501}};
  const Sums sums = hold_still(over_a_block(motion, X_WO), Pose{}, 0.15);
  CHECK(sums.last_T > 1e-7);
  CHECK(sums.worst < 0.01 * sums.most_T);
}

TEST_CASE("an obstacle at rest does no work, however large the contact force", "[obstacle_work]") {
  const Scene scene = over_a_block({}, {Quaterniond::Identity(), {0.0, 0.0, -0.051}});
  PenetrationDepth depth(scene, {});
  const Pose X_WP{Quaterniond::Identity(), {0.0, 0.0, -0.01}};
  const Penetration pressed = depth.follow(X_WP, Pose{}, kTick_s);
  REQUIRE(pressed.projection.energy > 0.0);
  CHECK(obstacle_work(pressed.projection, scene, 0.0, kTick_s) == 0.0);
}

}  // namespace
}  // namespace wrenchd::test_obstacle_work
