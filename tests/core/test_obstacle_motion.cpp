// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/finite.hpp"
#include "core/obstacle_motion.hpp"

namespace wrenchd::test_obstacle_motion {

namespace {

constexpr double kDay_s = 86400.0;
const Pose kStart = {rotation_from({0.3, -0.2, 0.5}), {0.1, 0.2, -0.3}};
const ObstacleMotion kStraight = {{0.1, -0.2, 0.3}, {0, 0, 0}, 0.0};
const ObstacleMotion kSpinning = {{0, 0, 0}, {1.0, -2.0, 0.5}, 0.0};
const ObstacleMotion kToAndFro = {{0.1, -0.2, 0.3}, {1.0, -2.0, 0.5}, 0.75};
const ObstacleMotion kFastest = {{3.0, 4.0, 0.0}, {30.0, 40.0, 0.0}, 0.0};

double apart(const Pose& a, const Pose& b) {
  return log(inverse(a) * b).norm();
}

}  // namespace

TEST_CASE("an obstacle without velocity keeps its pose bit for bit", "[motion]") {
  CHECK_FALSE(ObstacleMotion{}.moves());
  CHECK_FALSE(ObstacleMotion{{0, 0, 0}, {0, 0, 0}, 2.0}.moves());
  for (const double t : {-1.0, 0.0, 0.001, 1.0, kDay_s})
    CHECK(same_bits(ObstacleMotion{}.pose_at(kStart, t), kStart));
}

TEST_CASE("at time 0, before it, and at a time that is not finite, every motion is at its start",
          "[motion]") {
  for (const ObstacleMotion& motion : {kStraight, kSpinning, kToAndFro, kFastest}) {
    CHECK(motion.moves());
    for (const double t : {0.0, -0.0, -1e-9, -kDay_s, -std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()})
      CHECK(same_bits(motion.pose_at(kStart, t), kStart));
  }
}

TEST_CASE("the origin moves on a line, and the body rotates about it in axes of the world", "[motion]") {
  const Pose X = ObstacleMotion{{0.1, -0.2, 0.3}, {1.0, -2.0, 0.5}, 0.0}.pose_at(kStart, 0.5);
  CHECK((X.translation_m - Vector3d(0.15, 0.1, -0.15)).norm() < 1e-15);
  const Quaterniond turned = rotation_from({0.5, -1.0, 0.25}) * kStart.rotation;
  CHECK(X.rotation.angularDistance(turned) < 1e-15);
  // A pure translation keeps the rotation bit for bit, a pure rotation the position.
  CHECK(kStraight.pose_at(kStart, 0.5).rotation.coeffs() == kStart.rotation.coeffs());
  CHECK(kSpinning.pose_at(kStart, 0.5).translation_m == kStart.translation_m);
}

TEST_CASE("a periodic motion reverses at its ends, returns to its start, and has constant speed",
          "[motion]") {
  ObstacleMotion for_ever = kToAndFro;
  for_ever.reverse_after_s = 0.0;
  const double back_s = kToAndFro.reverse_after_s;
  for (const int round : {0, 1, 2, 1000, 1000000}) {
    const double start_s = 2.0 * back_s * round;  // exact in binary
    CHECK(same_bits(kToAndFro.pose_at(kStart, start_s), kStart));
    CHECK(same_bits(kToAndFro.pose_at(kStart, start_s + back_s), for_ever.pose_at(kStart, back_s)));
    for (const double s : {0.125, 0.25, 0.5, 0.625}) {
      CHECK(same_bits(kToAndFro.pose_at(kStart, start_s + s), for_ever.pose_at(kStart, s)));
      CHECK(same_bits(kToAndFro.pose_at(kStart, start_s + 2.0 * back_s - s), for_ever.pose_at(kStart, s)));
    }
  }
}

TEST_CASE("after days the pose is finite, has unit norm, and changes smoothly", "[motion]") {
  for (const ObstacleMotion& motion : {kStraight, kSpinning, kToAndFro, kFastest}) {
    const double tick_m_rad = 0.001 * (motion.linear_m_per_s.norm() + motion.angular_rad_per_s.norm());
    for (const double t : {1.0, kDay_s, 30 * kDay_s, 10000 * kDay_s}) {
      const Pose X = motion.pose_at(kStart, t);
      CHECK(is_finite(X));
      CHECK(std::abs(X.rotation.norm() - 1.0) < 1e-15);
      // At most the configured speed, up to the rounding of the time.
      const double rounding = 100.0 * (t * 2.3e-16);
      CHECK(apart(X, motion.pose_at(kStart, t + 0.001)) <= tick_m_rad * (1.0 + 1e-6) + rounding);
    }
    for (const double t :
         {1e12, 1e300, std::numeric_limits<double>::max(), std::numeric_limits<double>::infinity()}) {
      CHECK(is_finite(motion.pose_at(kStart, t)));
      CHECK(same_bits(motion.pose_at(kStart, t), motion.pose_at(kStart, ObstacleMotion::kMaxTime_s)));
    }
  }
}

TEST_CASE("after whole turns the rotation equals the start, and the quaternion is continuous", "[motion]") {
  const ObstacleMotion turn = {{0, 0, 0}, {0, 0, 2.0 * std::numbers::pi}, 0.0};  // one turn per second
  for (const double t : {1.0, 2.0, 3.0, 1000.0, 86401.0})
    CHECK(apart(turn.pose_at(kStart, t), kStart) < 1e-10);
  Quaterniond last = kStart.rotation;
  for (int i = 1; i < 5000; ++i) {
    const Quaterniond now = turn.pose_at(kStart, 0.001 * i).rotation;
    CHECK(last.dot(now) > 0.9999);
    last = now;
  }
}

TEST_CASE("a motion between two poses starts at its time, arrives, and stops", "[motion]") {
  const Pose X_to = {rotation_from({0.3, -0.2, 1.0}) * kStart.rotation, {1.0, -2.0, 0.5}};
  const ObstacleMotion motion = ObstacleMotion::between(kStart, X_to, 7.0, 2.5);
  for (const double t : {-1.0, 0.0, 6.999, 7.0}) CHECK(same_bits(motion.pose_at(kStart, t), kStart));
  CHECK(apart(motion.pose_at(kStart, 9.5), X_to) < 1e-12);
  for (const double t : {9.5001, 10.0, 1e9})
    CHECK(same_bits(motion.pose_at(kStart, t), motion.pose_at(kStart, 9.5)));
  const double speed = motion.linear_m_per_s.norm() + motion.angular_rad_per_s.norm();
  for (double t = 6.9; t < 9.6; t += 0.01)
    CHECK(apart(motion.pose_at(kStart, t), motion.pose_at(kStart, t + 0.01)) <= 0.01 * speed * (1.0 + 1e-9));
}

TEST_CASE("a periodic motion depends on the time since its start", "[motion]") {
  ObstacleMotion later = kToAndFro;
  later.start_s = 3.0;
  for (const double t : {3.0, 3.5, 4.25, 6.0, 10.5})
    CHECK(apart(later.pose_at(kStart, t), kToAndFro.pose_at(kStart, t - 3.0)) < 1e-12);
}

}  // namespace wrenchd::test_obstacle_motion
