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

/// The body in one cross-section (core/METHOD.md, section 7.1; paper, section 3.2). y is the obstacle normal.
/// The body is at p, so phi = 0.
struct PlanarBody {
  double m = 1.0;             ///< mass [kg]
  double H = 1.0;             ///< moment of inertia about the section normal, H_33 of Eq. (18) [kg m^2]
  double vx = 0.0, vy = 0.0;  ///< position of the vertex relative to the centre of mass [m]
  double h = 0.0;             ///< height of the centre of mass above the obstacle [m]
};

/// A cross-section with the range of angles in which both edges at the vertex stay above the plane, Eq. (21):
/// -pi <= theta_min <= pi,  theta_min <= theta_max <= theta_min + 2 pi.
struct PlanarSection : PlanarBody {
  double theta_min = 0.0;  ///< lower end of the range [rad]
  double theta_max = 0.0;  ///< upper end of the range [rad]
};

struct PlanarMinimum {
  double theta = 0.0;  ///< rotation from p to q about the section normal [rad]
  double beta = 0.0;   ///< height of the centre of mass at q [m]
  double T = 0.0;      ///< energy of Eq. (18) [kg m^2]
};

/// Admissible configuration of least energy in one section: Eqs. (20)-(32), METHOD (50)-(52). RT-safe.
PlanarMinimum minimise(const PlanarSection& section) noexcept;

/// The paper's analytical approximation (core/METHOD.md, section 7.1; paper, sections 3.2 and 3.3): planes
/// through the vertex that contain the contact normal. Each plane has a closed-form solution; the best one is
/// used.
class PlanarFamily {
 public:
  /// planes: N_delta of Eq. (40), at least 1. Keeps a reference to the body, which must outlive this object.
  PlanarFamily(const Inertia& M, const ConvexBody& body, int planes);

  int planes() const noexcept { return static_cast<int>(directions_.size()); }

  /// The best rotation within one plane of the family.
  struct InPlane {
    PlanarMinimum minimum;                ///< minimum in the plane; -pi <= theta <= pi
    Vector3d axis_W = Vector3d::UnitZ();  ///< rotation axis w_delta in W
  };

  /// The family at one contact: quantities common to all planes. Must not outlive the family.
  class AtContact {
   public:
    /// Solution of plane k, delta = k pi / N_delta, without other contacts. RT-safe.
    InPlane solve(int k) const noexcept;

   private:
    friend class PlanarFamily;
    AtContact(const PlanarFamily& family, const Pose& X_WP, const Contact& contact) noexcept;

    const PlanarFamily& family_;
    std::span<const std::uint32_t> ring_;  ///< neighbours of the vertex
    Vector3d apex_T_;                      ///< position of the vertex in T [m]
    Vector3d X_W_, Z_W_;                   ///< axes of the obstacle plane in W; (X, n, Z) is right-handed
    Vector3d X_T_, n_T_, Z_T_;             ///< plane axes and normal in T
    double v_X_, v_n_, v_Z_;               ///< vertex relative to the centre of mass, along X, n, Z [m]
    double H_XX_, H_XZ_, H_ZZ_;            ///< inertia about the axes of the obstacle plane [kg m^2]
    double h_;                             ///< height of the centre of mass above the obstacle [m]
  };
  /// The family at one contact. X_WP: body frame T at p. RT-safe.
  AtContact at(const Pose& X_WP, const Contact& contact) const noexcept { return {*this, X_WP, contact}; }

  /// Solution of plane k at one contact. RT-safe.
  InPlane solve(const Pose& X_WP, const Contact& contact, int k) const noexcept {
    return at(X_WP, contact).solve(k);
  }

  /// Configuration of a solution, Eq. (38). RT-safe.
  static Pose pose(const Pose& X_WP, const Contact& contact, const InPlane& solution) noexcept;

 private:
  struct Direction {
    double sine, cosine;  ///< sine and cosine of delta
  };

  Inertia M_;
  const ConvexBody& body_;
  std::vector<Direction> directions_;  ///< directions of the planes
};

}  // namespace wrenchd
