// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/contact.hpp"
#include "core/hessian.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// A contact relative to p: directions in the axes of p, lengths in units of L, METHOD (20).
///
///   gap/L = n(E) . (u + R_E a - b)        vertex_face: n . (u + R_E a) + c
struct LocalContact {
  Vector3d n;   ///< normal of a vertex_face contact
  Vector3d a;   ///< point a on the tool feature, in T
  Vector3d b;   ///< point b on the obstacle feature; zero for vertex_face
  double c;     ///< n . (x_p - b) of a vertex_face contact
  Vector3d d;   ///< d_T of a face_vertex or edge_edge contact
  Vector3d dB;  ///< d_W of a face_vertex or edge_edge contact, in the axes of p
  ContactKind kind;
};

/// A gap at a fixed rotation, minus the clearance: n . u + h, METHOD (21). n is the contact normal.
struct AffineGap {
  Vector3d n;
  double h;
};

/// Sums over the contacts with one normal, weighted with their multipliers.
struct WeightedContactSum {
  double m = 0.0;
  Vector3d a = Vector3d::Zero();
  Vector3d b = Vector3d::Zero();
  Vector3d angular_gradient = Vector3d::Zero();  ///< sum of the angular parts of the gap gradients
};

/// Sets `local` to `contact` relative to p. R_PW: rotation from W to the axes of p. L_m: unit of length.
/// Leaves d and dB of a vertex_face contact unchanged. RT-safe.
void make_local(const Contact& contact, const Pose& X_WP, const Matrix3d& R_PW, double L_m,
                LocalContact& local) noexcept;

/// The gap at the rotation R of E, minus the clearance (in units of L). RT-safe.
inline AffineGap affine_gap(const LocalContact& contact, const Matrix3d& R, double clearance) noexcept {
  switch (contact.kind) {
    case ContactKind::vertex_face:
      break;
    case ContactKind::face_vertex: {
      const Vector3d n = R * contact.d;
      return {n, contact.d.dot(contact.a) - n.dot(contact.b) - clearance};
    }
    case ContactKind::edge_edge: {
      const Vector3d N = (R * contact.d).cross(contact.dB);
      const Vector3d n = N * (1.0 / N.norm());
      return {n, n.dot(R * contact.a - contact.b) - clearance};
    }
  }
  return {contact.n, contact.n.dot(R * contact.a) + contact.c - clearance};
}

/// True if the gap at p (u = 0, E = 1) is below `least`. Without clearance the sign of an edge-edge gap needs
/// no normalization. RT-safe.
bool gap_at_p_below(const LocalContact& contact, double least) noexcept;

/// Gradient of a gap in (u, eta) for E <- E o (1, eta/2), METHOD (22). n: contact normal from affine_gap().
/// gap: the gap without clearance subtracted, in units of L. u, R: the state. RT-safe.
Vector6d gap_gradient(const LocalContact& contact, const Vector3d& n, double gap, const Vector3d& u,
                      const Matrix3d& R) noexcept;

/// Subtracts from `hessian` the second derivatives of all gaps with one normal, times their multipliers,
/// METHOD (24)-(26). The term of an edge-edge gap that is proportional to the gap is left out: a contact with
/// load has none. contact: any of the contacts. n: their normal. load: their weighted sum. RT-safe.
void subtract_gap_curvature(const LocalContact& contact, const Vector3d& n, const WeightedContactSum& load,
                            const Vector3d& u, const Matrix3d& R, HessianBlocks& hessian) noexcept;

}  // namespace wrenchd
