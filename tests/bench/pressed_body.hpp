// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "collision/scene.hpp"

namespace wrenchd::bench {

/// A body of about 0.1 m pressed into the half-space z < 0, and the poses p its hand goes through, a
/// millisecond apart.
struct PressedBody {
  std::string name;
  Scene scene;
  std::vector<Pose> X_WP;
};

/// The body stands on a shallow bowl with this many vertices, no two at the same height: each of them is
/// below the plane at every pose, no other vertex is, and which of them hold the body at q changes on the
/// way.
PressedBody pressed_bowl(std::size_t contacts, std::size_t poses);

/// The body stands on a flat face, a regular polygon with this many corners, at least 3, and hardly tilts:
/// all of them are below the plane at every pose, nearly equally deep.
PressedBody pressed_face(std::size_t contacts, std::size_t poses);

}  // namespace wrenchd::bench
