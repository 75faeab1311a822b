// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <istream>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/pose.hpp"
#include "core/simulation_settings.hpp"

namespace wrenchd {

/// A rejected table of poses: file, line, column, expected value and remedy.
class PoseTableError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads poses from CSV: header `px,py,pz,qx,qy,qz,qw`, then one pose per line, positions in metres,
/// quaternions of unit norm (within 1e-3; the function normalizes them). Blank lines are skipped. name: for
/// messages. Throws PoseTableError with up to ten messages. Not RT-safe: allocates.
std::vector<Pose> read_poses(std::istream& in, const std::string& name);

/// Reads timed poses: header `time_s,px,py,pz,qx,qy,qz,qw`. Times must ascend strictly; the result counts
/// them from the first. Rejects a time gap above kMaxTableGap_s, a speed above kMaxTableSpeed_m_per_s, a
/// rotation above kMaxTableRotation_rad between two lines, and an empty table. Not RT-safe: allocates.
std::vector<TimedPose> read_timed_poses(std::istream& in, const std::string& name);

inline constexpr double kMaxTableGap_s = 1.0;
inline constexpr double kMaxTableSpeed_m_per_s = 10.0;
inline constexpr double kMaxTableRotation_rad = 2.0;  ///< a larger rotation is ambiguous in direction

}  // namespace wrenchd
