// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Where the hand wants the handle, and how fast it wants it to move. B = device base, G = goal of the hand.
struct HandTarget {
  Pose X_BG;
  Twist V_BG;  ///< of G's origin, in base axes
};

/// A smooth way through poses at given times, on SE(3). Between two of them, h apart, with u = 0..1, position
/// and rotation are cubics of Hermite (Catmull and Rom 1974) that agree in pose and twist with their
/// neighbours:
///
///   p(u) = H(u; p0, h v0, p1, h v1),    R(u) = R0 exp(phi(u)),    phi(u) = H(u; 0, h w0, phi1, h w1')
///   phi1 = log(R0' R1),    w1' = Jr^-1(phi1) w1
///
/// v and w (in axes of G) at each pose are the mean rates over the two intervals beside it, at the ends zero:
/// it starts and ends at rest. Jr is the right Jacobian of exp.
class PoseSpline {
 public:
  /// Turns farther than this from one pose to the next could be meant either way round.
  static constexpr double kMaxRotation_rad = 2.0;

  /// Throws std::invalid_argument where there is no pose, a number is not finite, times do not rise strictly
  /// from 0, or a turn is too far.
  explicit PoseSpline(const std::vector<TimedPose>& poses);

  /// After the last pose the handle stays there. RT safe.
  HandTarget at(Duration since_start) const noexcept;
  double end_s() const noexcept { return knots_.back().time_s; }

 private:
  struct Knot {
    double time_s;
    Pose X_BG;
    Vector3d v_m_per_s;     ///< in B
    Vector3d w_rad_per_s;   ///< in G
    Vector3d rotation_rad;  ///< to the next, in G
  };
  std::vector<Knot> knots_;
};

}  // namespace wrenchd
