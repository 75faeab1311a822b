// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "collision/scene.hpp"

namespace wrenchd::bench {

/// A body of about 0.1 m pressed into the half-space z < 0, with the commanded poses p of the hand, 1 ms
/// apart.
struct PressedBody {
  std::string name;
  Scene scene;
  std::vector<Pose> X_WP;
};

/// The body stands on a shallow bowl with this many vertices at different heights. All of them, and no other
/// vertex, are below the plane at every pose. The set of active contacts at q changes along the path.
PressedBody pressed_bowl(std::size_t contacts, std::size_t poses);

/// The body stands on a flat regular polygon with this many corners, at least 3, and tilts little. All
/// corners are below the plane at every pose, at nearly equal depth.
PressedBody pressed_face(std::size_t contacts, std::size_t poses);

}  // namespace wrenchd::bench
