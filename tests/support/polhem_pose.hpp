// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "core/pose.hpp"

namespace wrenchd::test {

inline Matrix3d about_y(double angle) {
  return Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
}
inline Matrix3d about_x(double angle) {
  return Eigen::AngleAxisd(angle, Vector3d::UnitX()).toRotationMatrix();
}
inline Matrix3d about_z(double angle) {
  return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
}

/// Position and orientation of the end of polhem_v1 from encoder counts, by the formulas of
/// haptikfabrikenapi.
struct PolhemPose {
  Vector3d p;
  Matrix3d R;
  double tA, tB, tC;
};
inline PolhemPose polhem_pose(const std::array<int, 6>& counts) {
  const double turn = 2 * std::numbers::pi;
  const double tA = -turn * counts[0] / 2000 * 0.010 / 0.180, tB = -turn * counts[1] / 2000 * 0.010 / 0.100,
               tC = -turn * counts[2] / 2000 * 0.010 / 0.100;
  const double tD = -turn * counts[5] / 1024, tE = turn * counts[4] / 1024, tF = -turn * counts[3] / 1024;
  const double r = 0.174 * std::sin(tB) + 0.133 * std::sin(tC);
  return {{std::cos(tA) * r - 0.140, std::sin(tA) * r,
           0.058 + 0.174 * std::cos(tB) - 0.133 * std::cos(tC) - 0.100},
          about_z(tA) * about_y(std::numbers::pi / 2 - tC) * about_x(tD) * about_y(tE) * about_x(tF),
          tA,
          tB,
          tC};
}

/// Half a turn about z, which reverses x and y.
inline const Matrix3d kHalfTurn = Vector3d(-1, -1, 1).asDiagonal();

/// Returns the currents that the maker's software sends to the motors for a force in the base frame.
inline std::array<double, 3> polhem_currents_mA(const PolhemPose& place, const Vector3d& F_N) {
  const auto [p, R, tA, tB, tC] = place;
  const Vector3d f = kHalfTurn * F_N;
  const double r = 0.174 * std::sin(tB) + 0.133 * std::sin(tC);
  const std::array<double, 3> torque = {-std::sin(tA) * r * f.x() + std::cos(tA) * r * f.y(),
                                        0.174 * (std::cos(tA) * std::cos(tB) * f.x() +
                                                 std::sin(tA) * std::cos(tB) * f.y() - std::sin(tB) * f.z()),
                                        0.133 * (std::cos(tA) * std::cos(tC) * f.x() +
                                                 std::sin(tA) * std::cos(tC) * f.y() + std::sin(tC) * f.z())};
  const std::array<double, 3> gear = {-0.010 / 0.180, -0.010 / 0.100, -0.010 / 0.100};
  std::array<double, 3> currents_mA{};
  for (std::size_t j = 0; j < 3; ++j) currents_mA[j] = 1000 * torque[j] * gear[j] / 0.0538;
  return currents_mA;
}

}  // namespace wrenchd::test
