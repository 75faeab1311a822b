// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "core/cone_projection.hpp"
#include "core/contact.hpp"
#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// A contact between two bodies of a BodyWorld, or between a body and the fixed obstacles. Body a has the
/// part of the tool in `contact`, body b that of the obstacle: points and directions "in W" of the contact
/// are in the frame of b if b is a body.
struct BodyContact {
  static constexpr std::size_t kFixed = FrictionCone::kFixed;

  std::size_t a = 0, b = kFixed;  ///< numbers of the bodies
  Contact contact;
  double mu = 0.0;           ///< coefficient of friction
  double restitution = 0.0;  ///< coefficient of restitution
  double hold_m = 0.0;       ///< gap at which it is held in this step [m]
  /// Motion of the obstacle in this tick: X_WO(end) = obstacle_motion * X_WO(start). Identity for a body b.
  Pose obstacle_motion;
  Vector3d force_W_N = Vector3d::Zero();       ///< force on body a, in the last step
  Vector3d last_force_W_N = Vector3d::Zero();  ///< force on body a, in the step before
  Vector3d point_W_m = Vector3d::Zero();       ///< where it acted in the last step
  Vector3d normal_W = Vector3d::UnitZ();       ///< unit normal towards body a, where it acted
  double slip_m = 0.0;                         ///< length of the slip in the last step
  StaticVector<Vector3d, 4> active_normals;    ///< of its cone, at the last answer (ConeProjection)
  /// Its features do not face each other at the end of the last step. The next step begins without it.
  bool expired = false;
  /// Body number of the tool whose `curvature` is known in this step. kFixed: none.
  std::size_t curvature_of = kFixed;
  /// Second derivative of the gap by the translation of that tool in W and by its rotation in T.
  Matrix6d curvature;
};

/// The gap [m], the normal and the contact point in W of a contact. X_WA, X_WB: poses of its bodies; X_WB is
/// the identity if b is fixed.
struct ContactGeometry {
  double gap_m;
  Vector3d n_W;
  Vector3d point_W_m;
};

/// RT-safe.
inline ContactGeometry geometry_of(const BodyContact& c, const Pose& X_WA, const Pose& X_WB) noexcept {
  if (c.b == BodyContact::kFixed)
    return {gap_m(c.contact, X_WA), normal_W(c.contact, X_WA), contact_point_W(c.contact, X_WA)};
  const Pose X_BA = inverse(X_WB) * X_WA;
  return {gap_m(c.contact, X_BA), X_WB.rotation * normal_W(c.contact, X_BA),
          X_WB * contact_point_W(c.contact, X_BA)};
}

}  // namespace wrenchd
