// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/energy_law.hpp"

namespace wrenchd {

// q* minimises T for p. To first order the motion of q* does not change T (envelope theorem), so dU is that
// of T at fixed q. With (w, v) the unit quaternion of p^-1 q, METHOD (63), (64):
//
//   translation of p by ds in its own axes:   dU = -k m (R_p'(x_q - x_p)) . ds
//   rotation of p by eta in its own axes:     (w, v) becomes (1, -eta/2) o (w, v), dv = (v x eta - w eta)/2
//                                             dU = 4 k dv' H v = -2 k (w H v + v x (H v)) . eta
//
//   f   = k m R_p'(x_q - x_p)
//   tau = 2 k ( w H v + v x (H v) )
Wrench energy_wrench(const Inertia& M, double k_per_s2, const Pose& X_WP, const Pose& X_WQ) noexcept {
  Quaterniond E = X_WP.rotation.conjugate() * X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() *= -1.0;  // the shorter rotation
  const Vector3d v = E.vec();
  const Vector3d Hv = M.H_kg_m2 * v;
  const Vector3d s = X_WP.rotation.conjugate() * (X_WQ.translation_m - X_WP.translation_m);
  return {k_per_s2 * M.mass_kg * s, 2.0 * k_per_s2 * (E.w() * Hv + v.cross(Hv))};
}

}  // namespace wrenchd
