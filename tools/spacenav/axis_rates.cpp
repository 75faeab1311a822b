// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/spacenav/axis_rates.hpp"

#include <cmath>

#include <Eigen/Geometry>

namespace wrenchd {
namespace {

constexpr double kFullDeflection = 350.0;
constexpr double kMaxHandSpeed_m_per_s = 10.0;
constexpr double kMaxHandSpeed_rad_per_s = 100.0;

Eigen::Vector3d position_m(const PoseNumbers& X) {
  return {X[0], X[1], X[2]};
}

Eigen::Quaterniond rotation(const PoseNumbers& X) {
  return Eigen::Quaterniond(X[6], X[3], X[4], X[5]).normalized();
}

}  // namespace

AxisRates axis_rates(const PoseNumbers& X_from, const PoseNumbers& X_to, double dt_s,
                     const FullDeflection& full) noexcept {
  const Eigen::Vector3d v_m_per_s = (position_m(X_to) - position_m(X_from)) / dt_s;
  const Eigen::AngleAxisd turn(rotation(X_to) * rotation(X_from).conjugate());
  const double angle_rad = std::remainder(turn.angle(), 2.0 * M_PI);
  const Eigen::Vector3d w_rad_per_s = angle_rad / dt_s * turn.axis();
  // A comparison with NaN is false, so a pose that is not finite is rejected too.
  if (!(v_m_per_s.norm() <= kMaxHandSpeed_m_per_s && w_rad_per_s.norm() <= kMaxHandSpeed_rad_per_s))
    return {};
  const double counts_per_m_per_s = kFullDeflection / full.speed_m_per_s;
  const double counts_per_rad_per_s = kFullDeflection / full.speed_rad_per_s;
  return {-counts_per_m_per_s * v_m_per_s.y(),    counts_per_m_per_s * v_m_per_s.z(),
          counts_per_m_per_s * v_m_per_s.x(),     -counts_per_rad_per_s * w_rad_per_s.y(),
          counts_per_rad_per_s * w_rad_per_s.z(), counts_per_rad_per_s * w_rad_per_s.x()};
}

}  // namespace wrenchd
