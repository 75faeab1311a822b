// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/pairs/motion_predictor.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_motion_predictor {

namespace {

using namespace test;

constexpr double kRadius_m = 0.04;

double apart_m(const Pose& a, const Pose& b) {
  return (a.translation_m - b.translation_m).norm() + kRadius_m * a.rotation.angularDistance(b.rotation);
}

/// A hand that translates, rotates and accelerates.
Pose hand(double t) {
  return {rotation_from(t * Vector3d(0.0, 1e-3, 4e-4)), {0.10, 1e-4 * t + 1e-7 * t * t, -5e-5 * t}};
}

TEST_CASE("a predictor without motion predicts no motion", "[motion_predictor]") {
  MotionPredictor motion;
  CHECK_FALSE(motion.has_observation());
  motion.observe(hand(3), hand(0));
  CHECK(motion.has_observation());
  CHECK(apart_m(motion.predict(20), hand(3)) < 1e-15);
  CHECK(motion.chord_deviation_m(20, kRadius_m) == 0.0);
}

TEST_CASE("the prediction of a tool that moves with the hand is correct", "[motion_predictor]") {
  MotionPredictor motion;
  for (int i = 0; i <= 100; ++i) motion.observe(hand(i), hand(i));
  const double path_m = apart_m(hand(100), hand(120));
  CHECK(apart_m(motion.predict(0), hand(100)) < 1e-15);
  CHECK(apart_m(motion.predict(20), hand(120)) < 0.02 * path_m);
  // A parabola of 2e-7 m per tick^2 deviates from its chord by an eighth of that times 20^2.
  CHECK(motion.chord_deviation_m(20, 0.0) == Approx(1e-5).epsilon(0.01));
}

TEST_CASE("a held tool drifts from the hand in the prediction", "[motion_predictor]") {
  MotionPredictor motion;
  for (int i = 0; i <= 200; ++i) motion.observe(hand(0), hand(i));
  // The tool stays, except for the hand's gain in speed.
  CHECK(apart_m(motion.predict(10), hand(0)) < 0.1 * apart_m(hand(200), hand(210)));
}

TEST_CASE("a jittering tool is predicted to move with the hand", "[motion_predictor]") {
  RandomValues random(61);
  MotionPredictor motion;
  double farthest_m = 0.0;
  for (int i = 0; i <= 300; ++i) {
    const Pose jitters = {hand(i).rotation, hand(i).translation_m + 5e-6 * random.unit<3>()};
    motion.observe(jitters, hand(i));
    if (i > 100) farthest_m = std::max(farthest_m, apart_m(motion.predict(20), hand(i + 20)));
  }
  // From its own steps alone it would be predicted up to 20 steps of 1e-5 m away.
  CHECK(farthest_m < 1e-4);
}

TEST_CASE("after a reset the predictor predicts no motion", "[motion_predictor]") {
  MotionPredictor motion;
  for (int i = 0; i <= 50; ++i) motion.observe(hand(i), hand(i));
  motion.reset();
  CHECK_FALSE(motion.has_observation());
  motion.observe(hand(0), hand(0));
  CHECK(apart_m(motion.predict(20), hand(0)) < 1e-15);
}

TEST_CASE("a deferred tick predicts the tool where it would have moved", "[motion_predictor]") {
  MotionPredictor motion;
  motion.observe_deferred(hand(0));
  CHECK_FALSE(motion.has_observation());
  for (int i = 0; i <= 100; ++i) motion.observe(hand(i), hand(i));
  for (int i = 101; i <= 104; ++i) motion.observe_deferred(hand(i));
  const double path_m = apart_m(hand(100), hand(104));
  CHECK(apart_m(motion.predict(0), hand(104)) < 0.02 * path_m);
  CHECK(apart_m(motion.predict(20), hand(124)) < 0.02 * apart_m(hand(104), hand(124)));
}

}  // namespace
}  // namespace wrenchd::test_motion_predictor
