// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "core/inertia.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd::test {

/// Random values for property tests. The test fixes the seed, so that a failure is reproducible.
class RandomValues {
 public:
  explicit RandomValues(std::uint64_t seed) : engine_(seed) {}

  double uniform(double from, double to) { return from + (to - from) * uniform01_(engine_); }
  double normal() { return normal_(engine_); }
  /// Returns a value with a uniformly distributed logarithm. Both bounds must be positive.
  double log_uniform(double from, double to) { return std::exp(uniform(std::log(from), std::log(to))); }
  bool chance(double probability) { return uniform01_(engine_) < probability; }
  /// Returns an integer in [from, to].
  int integer(int from, int to) { return std::uniform_int_distribution<int>(from, to)(engine_); }
  std::uint64_t bits() { return engine_(); }

  template <int N>
  Eigen::Matrix<double, N, 1> vector(double scale = 1.0) {
    return Eigen::Matrix<double, N, 1>::NullaryExpr([&] { return scale * normal(); });
  }
  template <int N>
  Eigen::Matrix<double, N, 1> unit() {
    return vector<N>().normalized();
  }
  Quaterniond rotation() {
    Quaterniond q;
    q.coeffs() = unit<4>();
    return q;
  }
  Quaterniond rotation(double angle_rad) { return Quaterniond(Eigen::AngleAxisd(angle_rad, unit<3>())); }
  Pose pose(double distance_m = 1.0) { return {rotation(), vector<3>(distance_m)}; }
  /// Returns twist coordinates with a rotation of at most max_angle_rad.
  Vector6d twist(double distance_m, double max_angle_rad) {
    Vector6d xi;
    xi << vector<3>(distance_m), uniform(0.0, max_angle_rad) * unit<3>();
    return xi;
  }
  /// Returns the inertia of a physically possible body: H = m (tr(C) I - C) with a positive definite C.
  Inertia inertia(double size_m = 1.0) {
    const Matrix3d A = size_m * Matrix3d::NullaryExpr([&] { return normal(); });
    const Matrix3d C = A * A.transpose() + 0.01 * size_m * size_m * Matrix3d::Identity();
    const double mass_kg = log_uniform(0.1, 10.0);
    return {mass_kg, mass_kg * (C.trace() * Matrix3d::Identity() - C)};
  }
  Wrench wrench() { return {vector<3>(), vector<3>()}; }
  Twist velocity() { return {vector<3>(), vector<3>()}; }

 private:
  std::mt19937_64 engine_;
  std::uniform_real_distribution<double> uniform01_{0.0, 1.0};
  std::normal_distribution<double> normal_;
};

}  // namespace wrenchd::test
