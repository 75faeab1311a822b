// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/contact.hpp"
#include "core/convex_body.hpp"
#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// The planar body of one cross-section (section 3.2), in axes with the obstacle's normal as y, and the body
/// as it stands at p (so phi = 0).
struct PlanarSection {
  double m = 1.0;             ///< mass [kg]
  double H = 1.0;             ///< moment of inertia about the section's normal, H_33 of Eq. (18) [kg m^2]
  double vx = 0.0, vy = 0.0;  ///< the vertex, from the centre of mass [m]
  double h = 0.0;             ///< height of the centre of mass above the obstacle [m]
  double theta_min = 0.0;     ///< the angles at which both adjacent edges stay above the plane (Eq. 21) [rad]
  double theta_max = 0.0;
};

struct PlanarMinimum {
  double theta = 0.0;  ///< rotation from p, about the section's normal [rad]
  double beta = 0.0;   ///< height of the centre of mass at q [m]
  double T = 0.0;      ///< Eq. (18)
};

/// The least-energy admissible configuration of one section: Eqs. (20)-(32). RT safe.
PlanarMinimum minimise(const PlanarSection& section) noexcept;

/// The paper's analytical approximation (sections 3.2 and 3.3): the family of planes that contain the
/// contact's normal through its vertex, each solved in closed form, the best of them taken.
class PlanarFamily {
 public:
  /// planes: N_delta of Eq. (40). The body is kept by reference and must outlive this.
  PlanarFamily(const Inertia& M, const ConvexBody& body, int planes);

  int planes() const noexcept { return planes_; }

  /// The best rotation within one plane of the family, and its energy.
  struct InPlane {
    PlanarMinimum minimum;
    Vector3d axis_W = Vector3d::UnitZ();  ///< w_delta
  };
  /// Plane k of the family, delta = k pi / N_delta, as if this contact were the only one. X_WP: body frame T
  /// at p. RT safe.
  InPlane solve(const Pose& X_WP, const Contact& contact, int k) const noexcept;

  /// The configuration that goes with it, Eq. (38). RT safe.
  static Pose pose(const Pose& X_WP, const Contact& contact, const InPlane& solution) noexcept;

 private:
  struct Star;
  static PlanarSection limited(PlanarSection section, const Vector3d& e1, const Vector3d& n,
                               const Vector3d& w, const Star& star) noexcept;

  Inertia M_;
  const ConvexBody& body_;
  int planes_;
};

}  // namespace wrenchd
