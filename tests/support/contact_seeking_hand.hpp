// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {

/// A hand that brings faces of a tool onto faces of an obstacle, presses, slides and rotates. It picks a face
/// of each body at random, large faces more often, turns the tool until the faces are parallel and presses
/// them together; then it picks the next ones. It never moves farther from the proxy than a hand that yields
/// to the force.
///
/// With Approach::axis it presses the tool down along z onto the middle of the obstacle, as a knob on its
/// nut, shifts it by up to a millimetre, tilts it a little and turns it about z. Every other seed turns the
/// tool over.
class ContactSeekingHand {
 public:
  enum class Approach : std::uint8_t { faces, axis };
  struct Limits {
    double speed_m_per_s = 0.1, turn_rad_per_s = 2.0;
    double reach_m = 0.004, reach_rad = 0.1;  ///< largest distance from the proxy
    Approach approach = Approach::faces;
  };

  /// tool: in T. obstacle: in W. Keeps references to both, which must outlive this object.
  ContactSeekingHand(const TriangleMesh& tool, const TriangleMesh& obstacle, std::uint64_t seed,
                     Limits limits);

  /// Returns a pose at which the bounding spheres of the bodies are apart.
  const Pose& start() const { return X_WP_; }

  /// Returns the commanded pose of the next millisecond. X_WQ: the proxy's pose.
  const Pose& next(const Pose& X_WQ);

 private:
  struct Face {
    Vector3d p, n;
  };
  Face random_face(const TriangleMesh& mesh);
  void choose_target();
  void choose_axial_target();

  const TriangleMesh& tool_;
  const TriangleMesh& obstacle_;
  RandomValues random_;
  Limits limits_;
  Vector3d tool_middle_m_,
      middle_m_;           ///< middles of the bounding boxes of the tool, in T, and of the obstacle
  double away_m_;          ///< distance of the start from the obstacle's middle
  Quaterniond R_upright_;  ///< orientation for Approach::axis
  Pose X_WP_, X_target_;
  Vector3d slide_m_per_s_ = Vector3d::Zero();
  int ticks_left_ = 0;
};

}  // namespace wrenchd::test
