// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

namespace wrenchd {

/// Deflection of the six axes of a space mouse, in counts: x right, y up, z away from the user, then the
/// turns about these axes by the right-hand rule. 350 is the full deflection of a SpaceMouse.
using AxisRates = std::array<double, 6>;

/// Speeds that count as full deflection.
struct FullDeflection {
  double speed_m_per_s = 0.1;
  double speed_rad_per_s = 1.0;
};

/// Pose in the world (x forward, y left, z up): x y z [m], quaternion qx qy qz qw.
using PoseNumbers = std::array<double, 7>;

/// Returns the deflection that moves from one pose to the next one within dt_s. Zero if the poses are not
/// finite or farther apart than a hand moves (10 m/s, 100 rad/s): the device was replaced, or the workspace
/// has jumped. RT-safe.
AxisRates axis_rates(const PoseNumbers& X_from, const PoseNumbers& X_to, double dt_s,
                     const FullDeflection& full) noexcept;

}  // namespace wrenchd
