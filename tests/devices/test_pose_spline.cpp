// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "devices/pose_spline.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_pose_spline {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

/// An irregular trajectory with different time steps.
std::vector<TimedPose> wild_way() {
  RandomValues random(4);
  std::vector<TimedPose> poses;
  TimedPose at{0.0, {}};
  for (int i = 0; i < 60; ++i) {
    poses.push_back(at);
    at.time_s += 0.001 + 0.1 * std::abs(random.normal());
    at.X.translation_m += 0.02 * Vector3d(random.normal(), random.normal(), random.normal());
    Vector3d turn(random.normal(), random.normal(), random.normal());
    turn *= std::min(0.4, 1.9 / turn.norm());
    at.X.rotation = (at.X.rotation * rotation_from(turn)).normalized();
  }
  return poses;
}

}  // namespace

TEST_CASE("a pose spline passes through its poses at their times", "[pose_spline]") {
  const auto poses = wild_way();
  const PoseSpline track(poses);
  for (const TimedPose& pose : poses) {
    const Pose X = track.at(from_seconds(pose.time_s)).X_BG;
    CHECK((X.translation_m - pose.X.translation_m).norm() < 1e-7);  // one nanosecond at the highest speed
    CHECK(X.rotation.angularDistance(pose.X.rotation) < 1e-6);
  }
  CHECK(same_bits(track.at(from_seconds(1e6)).X_BG, poses.back().X));
  CHECK(track.at(from_seconds(1e6)).V_BG.linear_m_per_s.isZero());
  CHECK(same_bits(track.at(Duration{-5}).X_BG, poses.front().X));
}

TEST_CASE("the twist of a pose spline is the continuous derivative of its pose", "[pose_spline]") {
  const auto poses = wild_way();
  const PoseSpline track(poses);
  RandomValues random(5);
  const double end_s = poses.back().time_s;
  constexpr double kStep_s = 1e-6;
  const auto derivative = [&](double t_s) {
    const Pose a = track.at(from_seconds(t_s - kStep_s)).X_BG, b = track.at(from_seconds(t_s + kStep_s)).X_BG;
    return Twist{(b.translation_m - a.translation_m) / (2.0 * kStep_s),
                 rotation_vector(b.rotation * a.rotation.conjugate()) / (2.0 * kStep_s)};
  };
  for (int i = 0; i < 500; ++i) {
    const double t_s = 0.01 + std::fmod(std::abs(random.normal()), 1.0) * (end_s - 0.02);
    const Twist V = track.at(from_seconds(t_s)).V_BG, d = derivative(t_s);
    INFO(t_s);
    CHECK((V.linear_m_per_s - d.linear_m_per_s).norm() < 1e-3 * (1.0 + V.linear_m_per_s.norm()));
    CHECK((V.angular_rad_per_s - d.angular_rad_per_s).norm() < 1e-3 * (1.0 + V.angular_rad_per_s.norm()));
  }
  for (std::size_t i = 1; i + 1 < poses.size(); ++i) {
    const Duration t = from_seconds(poses[i].time_s);
    const Twist before = track.at(t - Duration{2}).V_BG, after = track.at(t + Duration{2}).V_BG;
    CHECK((before.linear_m_per_s - after.linear_m_per_s).norm() < 1e-3 * (1.0 + after.linear_m_per_s.norm()));
    CHECK((before.angular_rad_per_s - after.angular_rad_per_s).norm() <
          1e-3 * (1.0 + after.angular_rad_per_s.norm()));
  }
  CHECK(track.at(Duration{0}).V_BG.linear_m_per_s.norm() < 1e-9);
}

TEST_CASE("a pose spline reproduces a constant screw motion", "[pose_spline]") {
  std::vector<TimedPose> poses;
  for (int i = 0; i <= 20; ++i)
    poses.push_back({0.05 * i, {rotation_from({0.0, 0.0, 0.06 * i}), {0.01 * i, 0.0, 0.0}}});
  const PoseSpline track(poses);
  for (double t_s = 0.2; t_s < 0.8; t_s += 0.013) {
    const HandTarget at = track.at(from_seconds(t_s));
    CHECK(at.X_BG.translation_m.x() == Approx(0.2 * t_s).epsilon(1e-9));
    CHECK(rotation_vector(at.X_BG.rotation).z() == Approx(1.2 * t_s).epsilon(1e-9));
    CHECK(at.V_BG.angular_rad_per_s.z() == Approx(1.2).epsilon(1e-9));
  }
}

TEST_CASE("an invalid recorded path is rejected", "[pose_spline]") {
  const auto turned = [](double time_s, double angle) {
    return TimedPose{time_s, {rotation_from({angle, 0.0, 0.0}), Vector3d::Zero()}};
  };
  CHECK_THROWS_WITH(PoseSpline({}), Contains("has no pose"));
  CHECK_THROWS_WITH(PoseSpline({turned(0.1, 0.0)}), Contains("not at time 0"));
  CHECK_THROWS_WITH(PoseSpline({turned(0.0, 0.0), turned(0.0, 0.1)}), Contains("times must rise"));
  CHECK_THROWS_WITH(PoseSpline({turned(0.0, 0.0), turned(0.1, 2.1)}), Contains("to be unambiguous"));
  CHECK_THROWS_WITH(PoseSpline({turned(0.0, 0.0), turned(std::nan(""), 0.1)}), Contains("not finite"));
  CHECK(PoseSpline({turned(0.0, 0.5)}).at(from_seconds(3.0)).X_BG.rotation.x() == Approx(std::sin(0.25)));
}

}  // namespace wrenchd::test_pose_spline
