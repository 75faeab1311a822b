// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/contact.hpp"
#include "core/convex_body.hpp"
#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// The planar body of one cross-section (section 3.2), in axes with the obstacle's normal as y, and the body
/// as it stands at p (so phi = 0).
struct PlanarBody {
  double m = 1.0;             ///< mass [kg]
  double H = 1.0;             ///< moment of inertia about the section's normal, H_33 of Eq. (18) [kg m^2]
  double vx = 0.0, vy = 0.0;  ///< the vertex, from the centre of mass [m]
  double h = 0.0;             ///< height of the centre of mass above the obstacle [m]
};

/// With the angles at which both adjacent edges stay above the plane (Eq. 21):
/// -pi <= theta_min <= pi,  theta_min <= theta_max <= theta_min + 2 pi.
struct PlanarSection : PlanarBody {
  double theta_min = 0.0;  ///< [rad]
  double theta_max = 0.0;  ///< [rad]
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

  int planes() const noexcept { return static_cast<int>(directions_.size()); }

  /// The best rotation within one plane of the family, and its energy.
  struct InPlane {
    PlanarMinimum minimum;                ///< -pi <= theta <= pi
    Vector3d axis_W = Vector3d::UnitZ();  ///< w_delta
  };

  /// The family at one contact: what its planes share, worked out once. Must not outlive the family.
  class AtContact {
   public:
    /// Plane k, delta = k pi / N_delta, as if this contact were the only one. RT safe.
    InPlane solve(int k) const noexcept;

   private:
    friend class PlanarFamily;
    AtContact(const PlanarFamily& family, const Pose& X_WP, const Contact& contact) noexcept;

    const PlanarFamily& family_;
    std::span<const std::uint32_t> ring_;  ///< the vertex's neighbours
    Vector3d apex_T_;                      ///< the vertex
    Vector3d X_W_, Z_W_;                   ///< span the obstacle plane; (X, n, Z) is right-handed
    Vector3d X_T_, n_T_, Z_T_;             ///< the same and the normal in the body, which then need not turn
    double v_X_, v_n_, v_Z_;               ///< the vertex from the centre of mass
    double H_XX_, H_XZ_, H_ZZ_;            ///< inertia about the axes in the obstacle plane
    double h_;                             ///< height of the centre of mass
  };
  /// X_WP: body frame T at p. RT safe.
  AtContact at(const Pose& X_WP, const Contact& contact) const noexcept { return {*this, X_WP, contact}; }

  /// One plane alone. RT safe.
  InPlane solve(const Pose& X_WP, const Contact& contact, int k) const noexcept {
    return at(X_WP, contact).solve(k);
  }

  /// The configuration that goes with it, Eq. (38). RT safe.
  static Pose pose(const Pose& X_WP, const Contact& contact, const InPlane& solution) noexcept;

 private:
  struct Direction {
    double sine, cosine;  ///< of delta
  };

  Inertia M_;
  const ConvexBody& body_;
  std::vector<Direction> directions_;  ///< of the planes
};

}  // namespace wrenchd
