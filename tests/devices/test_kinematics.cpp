// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/kinematics.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_kinematics {

namespace {

Kinematics shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml").kinematics;
}

const Kinematics kPolhem = shipped("polhem");
const Kinematics kWood = shipped("woodenhaptics");
const Kinematics kFalcon = shipped("falcon");

double distance(const Pose& a, const Pose& b) {
  return std::max((a.translation_m - b.translation_m).norm(), a.rotation.angularDistance(b.rotation));
}

/// Joint angles throughout the workspace, with the elbow of the real device.
struct Angles {
  std::mt19937_64 random{7};

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  JointAngles arm() {
    const double tB = between(-0.6, 0.8);
    // With body c folded onto b the arm is straight and both elbows coincide: keep 0.3 rad away from both
    // ends.
    return {between(-1.0, 1.0), tB, between(0.9, 2.2), between(-1.5, 1.5), between(0.3, 1.3),
            between(-2.0, 2.0)};
  }
  Vector3d in_falcon() { return {between(-0.04, 0.04), between(-0.04, 0.04), between(0.095, 0.165)}; }
};

/// Central differences of the position over the driven joints.
Matrix3d differenced(const Kinematics& k, const JointAngles& at, const Pose& near) {
  constexpr double h = 1e-6;
  Matrix3d J;
  for (std::size_t i = 0; i < 3; ++i) {
    JointAngles up = at, down = at;
    up[i] += h;
    down[i] -= h;
    J.col(static_cast<Eigen::Index>(i)) =
        (forward_kinematics(k, up, near)->translation_m - forward_kinematics(k, down, near)->translation_m) /
        (2 * h);
  }
  return J;
}

}  // namespace

TEST_CASE("capstan arm: forward and inverse kinematics are inverse to each other", "[kinematics]") {
  Angles angles;
  for (int i = 0; i < 20'000; ++i) {
    const JointAngles t = angles.arm();
    for (const Kinematics* k : {&kPolhem, &kWood}) {
      const auto X_DE = forward_kinematics(*k, t, {});
      REQUIRE(X_DE);
      const auto back = inverse(*k, *X_DE);
      REQUIRE(back);
      for (std::size_t j = 0; j < k->joints; ++j) REQUIRE(std::abs((*back)[j] - t[j]) < 1e-10);
      REQUIRE(distance(*forward_kinematics(*k, *back, {}), *X_DE) <
              1e-7);  // angularDistance() of equal rotations: 1e-8
    }
  }
}

TEST_CASE("delta: forward and inverse kinematics are inverse to each other for any initial guess",
          "[kinematics]") {
  Angles angles;
  Pose near;
  for (int i = 0; i < 20'000; ++i) {
    const Pose X_DE{Quaterniond::Identity(), angles.in_falcon()};
    const auto t = inverse(kFalcon, X_DE);
    REQUIRE(t);
    const auto back = forward_kinematics(kFalcon, *t, near);
    REQUIRE(back);
    REQUIRE((back->translation_m - X_DE.translation_m).norm() < 1e-12);
    near = i % 3 == 0 ? Pose{} : X_DE;
  }
}

TEST_CASE("counts and angles convert into each other", "[kinematics]") {
  Angles angles;
  for (int i = 0; i < 1000; ++i) {
    JointCounts counts{};
    for (double& count : counts) count = std::round(angles.between(-20'000, 20'000));
    for (const Kinematics* k : {&kPolhem, &kFalcon}) {
      const JointCounts back = joint_counts(*k, joint_angles(*k, counts));
      for (std::size_t j = 0; j < k->joints; ++j) REQUIRE(back[j] == Approx(counts[j]).margin(1e-8));
    }
  }
}

TEST_CASE("the Jacobian agrees with finite differences of the position", "[kinematics]") {
  Angles angles;
  for (int i = 0; i < 2000; ++i) {
    const JointAngles t = angles.arm();
    for (const Kinematics* k : {&kPolhem, &kWood}) {
      const Pose X_DE = *forward_kinematics(*k, t, {});
      REQUIRE((jacobian(*k, t, X_DE) - differenced(*k, t, X_DE)).cwiseAbs().maxCoeff() < 1e-9);
    }
    const Pose X_DE{Quaterniond::Identity(), angles.in_falcon()};
    const JointAngles thighs = *inverse(kFalcon, X_DE);
    const Matrix3d J = jacobian(kFalcon, thighs, X_DE);
    REQUIRE((J - differenced(kFalcon, thighs, X_DE)).cwiseAbs().maxCoeff() < 1e-7 * (1 + J.norm()));
  }
}

TEST_CASE("joint torques and the force on the hand do equal work", "[kinematics]") {
  Angles angles;
  const auto check = [&](const Kinematics& k, const JointAngles& t, const Pose& X_DE) {
    const Vector3d f(angles.between(-1, 1), angles.between(-1, 1), angles.between(-1, 1));
    const Vector3d rate(angles.between(-3, 3), angles.between(-3, 3), angles.between(-3, 3));
    const Matrix3d J = jacobian(k, t, X_DE);
    const Vector3d tau = joint_torques(k, motor_efforts(k, J, 0.1 * f));
    const double at_joints = tau.dot(rate), at_hand = (0.1 * f).dot(J * rate);
    REQUIRE(at_joints == Approx(at_hand).margin(1e-12));
  };
  for (int i = 0; i < 5000; ++i) {
    const JointAngles t = angles.arm();
    check(kPolhem, t, *forward_kinematics(kPolhem, t, {}));
    check(kWood, t, *forward_kinematics(kWood, t, {}));
    const Pose X_DE{Quaterniond::Identity(), angles.in_falcon()};
    check(kFalcon, *inverse(kFalcon, X_DE), X_DE);
  }
}

TEST_CASE("one factor scales all efforts, so the force keeps its direction", "[kinematics]") {
  Angles angles;
  for (int i = 0; i < 2000; ++i) {
    const Pose X_DE{Quaterniond::Identity(), angles.in_falcon()};
    const Matrix3d J = jacobian(kFalcon, *inverse(kFalcon, X_DE), X_DE);
    const Vector3d f(angles.between(-99, 99), angles.between(-99, 99), angles.between(-99, 99));
    const MotorEfforts efforts = motor_efforts(kFalcon, J, f);
    for (const double effort : efforts) REQUIRE(std::abs(effort) <= 4096.0 * (1 + 1e-12));
    const Vector3d made = J.transpose().inverse() * joint_torques(kFalcon, efforts);
    REQUIRE(made.normalized().dot(f.normalized()) > 1 - 1e-9);
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(motor_efforts(kFalcon, Matrix3d::Identity(), {nan, 0, 0}) == MotorEfforts{});
}

TEST_CASE("the kinematics gives the positions stated in the sources", "[kinematics]") {
  // haptikfabrikenapi, polhem_v1: at its calibration counts body b is upright and body c is level.
  const Pose polhem = *home_pose(kPolhem);
  CHECK(polhem.translation_m.isApprox(Vector3d(0.133 - 0.140, 0.0, 0.058 + 0.174 - 0.100), 1e-12));
  CHECK(polhem.rotation.angularDistance(Quaterniond::Identity()) < 1e-7);
  CHECK(home_pose(kWood)->translation_m.isApprox(Vector3d(0.245 - 0.220, 0.0, 0.080 + 0.205 - 0.080), 1e-12));

  // A quarter turn of body a: 2000 counts per turn, capstan 10 mm on 180 mm, so 18 motor turns per turn.
  JointCounts counts = kPolhem.home_counts;
  counts[0] = -9000;
  const JointAngles t = joint_angles(kPolhem, counts);
  CHECK(t[0] == Approx(std::numbers::pi / 2));
  CHECK(forward_kinematics(kPolhem, t, {})->translation_m.isApprox(Vector3d(-0.140, 0.133, 0.132), 1e-12));

  // libnifalcon: 35 degrees at count 0, and 360/1280 * 14.25/110 degrees per count.
  CHECK(joint_angles(kFalcon, {0, 100, -100})[0] == Approx(35 * std::numbers::pi / 180));
  CHECK(joint_angles(kFalcon, {0, 100, -100})[1] ==
        Approx((35 + 100 * 360.0 / 1280 * 14.25 / 110) * std::numbers::pi / 180));
  CHECK(home_pose(kFalcon)->translation_m.head<2>().norm() < 1e-12);  // equal legs: on the axis
  CHECK(home_pose(kFalcon)->translation_m.z() == Approx(0.134602).margin(1e-6));
}

TEST_CASE("a force of 1 N upward on a Polhem at home loads body c alone", "[kinematics]") {
  // tau = c sin(pi/2) * 1 N = 0.133 N.m; motor: times -10/100 over 0.0538 N.m/A
  const JointAngles t = joint_angles(kPolhem, kPolhem.home_counts);
  const MotorEfforts up = motor_efforts(kPolhem, jacobian(kPolhem, t, *home_pose(kPolhem)), {0, 0, 1});
  CHECK(up[0] == Approx(0).margin(1e-12));
  CHECK(up[1] == Approx(0).margin(1e-12));
  CHECK(up[2] == Approx(-0.133 * 0.1 / 0.0538));
}

TEST_CASE("an unreachable pose and impossible angles give no result", "[kinematics]") {
  CHECK_FALSE(inverse(kPolhem, {Quaterniond::Identity(), {1.0, 0.0, 0.0}}));
  CHECK_FALSE(inverse(kFalcon, {Quaterniond::Identity(), {0.0, 0.0, 0.3}}));
  CHECK_FALSE(forward_kinematics(kFalcon, {-1.5, 1.5, 1.5}, {}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(forward_kinematics(kFalcon, {nan, 0.5, 0.5}, {}));
}

TEST_CASE("the offset of a button is removed from its count", "[kinematics]") {
  std::uint32_t buttons = 0xf0;
  JointCounts counts{1, 2, 3, 10'123, 5, 6};
  CHECK(strip_count_button(kPolhem, counts, buttons) == JointCounts{1, 2, 3, 123, 5, 6});
  CHECK(buttons == 0xf1);
  counts[3] = 5000;
  CHECK(strip_count_button(kPolhem, counts, buttons) == counts);
  CHECK(buttons == 0xf0);
}

}  // namespace wrenchd::test_kinematics
