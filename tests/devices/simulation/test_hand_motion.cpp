// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "devices/simulation/hand_motion.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_hand_motion {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

constexpr double kStep_s = 1.0 / 16000.0;
constexpr Duration kStep = 62'500ns;

SimulationSettings circling_hand() {
  SimulationSettings s;
  s.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0, 0, 0}},
                 {0.5, {0.02, 0.01, -0.02}, {0.3, 0.0, 0.1}},
                 {1.0, {0.0, 0.0, 0.05}, {0, 0, 0}}};
  return s;
}

/// The motion with its time.
struct Hand {
  HandMotion motion;
  HandPath path;
  TimePoint start{1h};
  TimePoint now{1h};

  explicit Hand(const SimulationSettings& settings = circling_hand()) : motion(settings), path(settings) {}
  HandTarget step() {
    now += kStep;
    return motion.advance(now, now - start, kStep_s);
  }
  void run(Duration duration) {
    for (const TimePoint end = now + duration; now < end;) step();
  }
  Pose on_path() const { return path.at(now - start).X_BG; }
};

double distance_m(const Pose& a, const Pose& b) {
  return (a.translation_m - b.translation_m).norm();
}
double angle_rad(const Pose& a, const Pose& b) {
  return rotation_vector(a.rotation * b.rotation.conjugate()).norm();
}

}  // namespace

TEST_CASE("without a goal the hand is exactly on its path", "[hand_motion]") {
  Hand hand;
  CHECK(same_bits(hand.motion.target().X_BG, hand.path.at(Duration{0}).X_BG));
  bool equal = true;
  for (int i = 0; i < 20'000; ++i) {
    const Pose X_BG = hand.step().X_BG;
    equal = equal && same_bits(X_BG, hand.on_path());
  }
  CHECK(equal);
}

TEST_CASE("the hand presses the grasp button from one waypoint to the next", "[hand_motion]") {
  SimulationSettings s = circling_hand();
  s.hand_path[1].grasp = true;
  const HandMotion repeats(s);
  CHECK_FALSE(repeats.grasps(499ms));
  CHECK(repeats.grasps(500ms));
  CHECK(repeats.grasps(999ms));
  CHECK_FALSE(repeats.grasps(1s));
  CHECK(repeats.grasps(1500ms));
  s.hand_repeats = false;
  s.hand_path[2].grasp = true;
  CHECK(HandMotion(s).grasps(5s));  // the hand stays at the last waypoint
}

TEST_CASE("the hand reaches a goal without overshoot, stays there, and returns to its moving path",
          "[hand_motion]") {
  Hand hand;
  hand.run(300ms);
  const Pose goal{rotation_from(Vector3d(0.0, 0.8, 0.0)), {0.15, 0.0, 0.0}};
  const Vector3d way = goal.translation_m - hand.on_path().translation_m;
  REQUIRE(hand.motion.set_goal({goal, hand.now + 1s}));
  double farthest = 0.0;
  for (int i = 0; i < 8000; ++i) {
    const Pose X = hand.step().X_BG;
    farthest = std::max(farthest, (X.translation_m - goal.translation_m).dot(way.normalized()));
  }
  CHECK(farthest < 1e-6);
  CHECK(distance_m(hand.motion.target().X_BG, goal) < 1e-6);
  CHECK(angle_rad(hand.motion.target().X_BG, goal) < 1e-5);
  CHECK(hand.motion.target().V_BG.linear_m_per_s.norm() < 1e-4);
  hand.run(450ms);
  CHECK(distance_m(hand.motion.target().X_BG, goal) < 1e-9);
  hand.run(1500ms);  // the goal expired in the first 50 ms of this
  CHECK(same_bits(hand.motion.target().X_BG, hand.on_path()));
}

TEST_CASE("the hand follows a streamed goal with a lag of one over its gain", "[hand_motion]") {
  Hand hand;
  const auto goal_at = [&](TimePoint t) {
    return Vector3d(0.2 * seconds(t - hand.start), 0.0, 0.05);  // 0.2 m/s
  };
  double largest_lag_m = 0.0;
  for (int i = 0; i < 16'000; ++i) {
    if (i % 160 == 0) hand.motion.set_goal({{Quaterniond::Identity(), goal_at(hand.now)}, hand.now + 100ms});
    const Pose X = hand.step().X_BG;
    if (i > 8000) largest_lag_m = std::max(largest_lag_m, goal_at(hand.now).x() - X.translation_m.x());
  }
  CHECK(largest_lag_m > 0.9 * 0.2 / HandMotion::kGain_per_s);
  CHECK(largest_lag_m < 0.2 / HandMotion::kGain_per_s + 0.2 * 0.0125);  // and one goal of 10 ms
}

TEST_CASE("whatever goals arrive, speed and acceleration of the hand stay those of a person",
          "[hand_motion]") {
  SimulationSettings still;
  still.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0, 0, 0}}};
  RandomValues random(41);
  Hand hand(still);
  Twist last = hand.motion.target().V_BG;
  double largest_m_per_s = 0.0, largest_rad_per_s = 0.0, largest_m_per_s2 = 0.0, largest_rad_per_s2 = 0.0;
  for (int i = 0; i < 200'000; ++i) {
    if (random.chance(0.01)) {
      const Pose goal{rotation_from(random.unit<3>() * random.uniform(0.0, 6.0)),
                      random.unit<3>() * random.uniform(0.0, 1.0)};
      hand.motion.set_goal({goal, hand.now + from_seconds(random.uniform(-0.01, 0.1))});
    }
    const Twist V = hand.step().V_BG;
    largest_m_per_s = std::max(largest_m_per_s, V.linear_m_per_s.norm());
    largest_rad_per_s = std::max(largest_rad_per_s, V.angular_rad_per_s.norm());
    const double dv = (V.linear_m_per_s - last.linear_m_per_s).norm();
    const double dw = (V.angular_rad_per_s - last.angular_rad_per_s).norm();
    largest_m_per_s2 = std::max(largest_m_per_s2, dv / kStep_s);
    largest_rad_per_s2 = std::max(largest_rad_per_s2, dw / kStep_s);
    last = V;
  }
  CHECK(largest_m_per_s > 1.0);
  CHECK(largest_m_per_s < HandMotion::kMaxSpeed_m_per_s + 1e-9);
  CHECK(largest_rad_per_s > 10.0);
  CHECK(largest_rad_per_s < HandMotion::kMaxSpeed_rad_per_s + 1e-9);
  CHECK(largest_m_per_s2 > 45.0);
  CHECK(largest_m_per_s2 < HandMotion::kMaxAcceleration_m_per_s2 * (1.0 + 1e-9));
  CHECK(largest_rad_per_s2 < HandMotion::kMaxAcceleration_rad_per_s2 * (1.0 + 1e-9));
}

TEST_CASE("a handle that is exactly on a recorded path has no goal", "[hand_motion]") {
  SimulationSettings recorded = circling_hand();
  recorded.playback_mode = PlaybackMode::open;
  recorded.playback_path = {{0.0, {}}, {1.0, {Quaterniond::Identity(), {0.01, 0.0, 0.0}}}};
  Hand hand(recorded);
  CHECK(hand.motion.prescribed());
  CHECK_FALSE(hand.motion.set_goal({{}, hand.now + 1s}));
}

}  // namespace wrenchd::test_hand_motion
