// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Goal pose of the hand and its velocity. B = device base, G = goal of the hand.
struct HandTarget {
  Pose X_BG;
  Twist V_BG;  ///< velocity of the origin of G, in B
};

/// Smooth trajectory through timed poses on SE(3). Between two poses at an interval h, with u = 0..1,
/// position and rotation are cubic Hermite polynomials (Catmull and Rom 1974). Adjacent segments agree in
/// pose and twist:
///
///   p(u) = H(u; p0, h v0, p1, h v1),    R(u) = R0 exp(phi(u)),    phi(u) = H(u; 0, h w0, phi1, h w1')
///   phi1 = log(R0' R1),    w1' = Jr^-1(phi1) w1
///
/// v and w (in axes of G) at each pose are the mean velocities of the two adjacent intervals. They are zero
/// at both ends, so the trajectory starts and ends at rest. Jr is the right Jacobian of exp.
class PoseSpline {
 public:
  /// Maximum rotation between consecutive poses. The direction of a larger rotation would be ambiguous.
  static constexpr double kMaxRotation_rad = 2.0;

  /// Throws std::invalid_argument if there is no pose, a number is not finite, times do not rise strictly
  /// from 0, or a rotation exceeds kMaxRotation_rad. Not RT-safe: allocates.
  explicit PoseSpline(const std::vector<TimedPose>& poses);

  /// Returns the target at a time after the start. After the last pose the target stays there. RT-safe.
  HandTarget at(Duration since_start) const noexcept;
  double end_s() const noexcept { return knots_.back().time_s; }

 private:
  struct Knot {
    double time_s;
    Pose X_BG;
    Vector3d v_m_per_s;     ///< in B
    Vector3d w_rad_per_s;   ///< in G
    Vector3d rotation_rad;  ///< rotation vector to the next knot, in G
  };
  std::vector<Knot> knots_;
};

}  // namespace wrenchd
