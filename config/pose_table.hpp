// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <istream>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/pose.hpp"
#include "core/simulation_settings.hpp"

namespace wrenchd {

/// A table of poses that cannot be used: file, line, column, what was expected, and the cure.
class PoseTableError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads poses from CSV: the header `px,py,pz,qx,qy,qz,qw`, then a pose a line, positions in metres,
/// quaternions of unit norm (to 1e-3; they are normalised). Blank lines are passed over. name: for messages.
/// Throws PoseTableError that lists what is wrong, up to ten lines of it; nothing is returned then.
std::vector<Pose> read_poses(std::istream& in, const std::string& name);

/// The same with a time in front: the header `time_s,px,py,pz,qx,qy,qz,qw`. Times rise strictly; they come
/// back as counted from the first. Refused too: a gap in time of more than kMaxTableGap_s, a jump that no
/// hand makes (faster than kFastest_m_per_s), a turn of more than kFarthestTurn_rad, and a table without
/// poses.
std::vector<TimedPose> read_timed_poses(std::istream& in, const std::string& name);

inline constexpr double kMaxTableGap_s = 1.0;
inline constexpr double kMaxTableSpeed_m_per_s = 10.0;
inline constexpr double kMaxTableRotation_rad = 2.0;  ///< farther could be meant either way round

}  // namespace wrenchd
