// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <istream>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/pose.hpp"

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

}  // namespace wrenchd
