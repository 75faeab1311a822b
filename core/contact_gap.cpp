// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/contact_gap.hpp"

namespace wrenchd {

void make_local(const Contact& contact, const Pose& X_WP, const Matrix3d& R_PW, double L_m,
                LocalContact& local) noexcept {
  local.kind = contact.kind;
  local.n = R_PW * contact.n_W;
  local.a = contact.p_TCa_m / L_m;
  local.b.setZero();
  local.c = (contact.n_W.dot(X_WP.translation_m) - contact.offset_m) / L_m;
  if (contact.kind == ContactKind::vertex_face) return;
  local.b = R_PW * (contact.p_WCb_m - X_WP.translation_m) / L_m;
  local.d = contact.d_T;
  local.dB = R_PW * contact.d_W;
}

bool gap_at_p_below(const LocalContact& contact, double least) noexcept {
  switch (contact.kind) {
    case ContactKind::vertex_face:
      break;
    case ContactKind::face_vertex:
      return contact.d.dot(contact.a - contact.b) < least;
    case ContactKind::edge_edge: {
      const Vector3d N = contact.d.cross(contact.dB);
      return N.dot(contact.a - contact.b) < (least > 0.0 ? least * N.norm() : least);
    }
  }
  return contact.n.dot(contact.a) + contact.c < least;
}

// For E <- E o (1, eta/2) and n_Q = R'n, r = R'(u - b) + a, all in the axes of q, the gradient of a gap is
// METHOD (22)
//
//   J = [ n ; a x n_Q + rotation of the normal ]
//
//   vertex_face   0
//   face_vertex   d x r                                      n_Q = d
//   edge_edge     d x (dB_Q x r_t) / s                       r_t: r without its part along n,  s = |d x dB_Q|
Vector6d gap_gradient(const LocalContact& contact, const Vector3d& n, double gap, const Vector3d& u,
                      const Matrix3d& R) noexcept {
  const Vector3d n_Q = R.transpose() * n;
  Vector3d angular = contact.a.cross(n_Q);
  if (contact.kind != ContactKind::vertex_face) {
    const Vector3d r = R.transpose() * (u - contact.b) + contact.a;
    if (contact.kind == ContactKind::face_vertex) {
      angular += contact.d.cross(r);
    } else {
      const Vector3d dB = R.transpose() * contact.dB;
      angular += contact.d.cross(dB.cross(r - gap * n_Q)) / contact.d.cross(dB).norm();
    }
  }
  Vector6d J;
  J.head<3>() = n;
  J.tail<3>() = angular;
  return J;
}

// Second derivatives of a gap for R = I + eta^ + eta^^2/2, in the axes of q. With sym(x, y) = (x y' + y x')/2
// and M(x, y) = sym(x, y) - (x . y) I, which is the Hessian of x . R y:
//
//   vertex_face   eta eta: M(n, a)                                               METHOD (24)
//   face_vertex   eta eta: M(d, w), w = R'(u - b)            eta u: d^ R' = -(n^ R)'       METHOD (25)
//   edge_edge     gap = f/s with f = (d x dB) . r, s = |d x dB|:                 METHOD (26)
//     f:  eta eta: M(dB x r, d) - 2 sym(dB, d x a) + M(d x dB, a)
//         eta u: d^ dB^ R' = (R d dB' - (d . dB) R)'
//     s:  gradient g_s = -(d . dB) n
//     gap: (K_f - J g_s' - g_s J')/s, without the term proportional to the gap
void subtract_gap_curvature(const LocalContact& contact, const Vector3d& n, const WeightedContactSum& load,
                            const Vector3d& u, const Matrix3d& R, HessianBlocks& hessian) noexcept {
  const auto R_T = R.transpose();
  const Vector3d n_Q = R_T * n;
  // B -= M(x, y), given x y' and x . y
  const auto subtract_M = [&](const Matrix3d& xy, double trace) {
    hessian.B -= 0.5 * (xy + xy.transpose());
    hessian.B.diagonal().array() += trace;
  };
  if (contact.kind == ContactKind::vertex_face) {
    subtract_M(n_Q * load.a.transpose(), n_Q.dot(load.a));
    return;
  }
  const Vector3d w = R_T * (load.m * u - load.b);
  if (contact.kind == ContactKind::face_vertex) {
    subtract_M(contact.d * w.transpose(), contact.d.dot(w));
    for (int j = 0; j < 3; ++j) hessian.C.col(j) += load.m * n.cross(R.col(j));
    return;
  }
  const Vector3d dB = R_T * contact.dB;
  const double cosine = contact.d.dot(dB);
  const double s = contact.d.cross(dB).norm();
  const Vector3d lever = dB.cross(w + load.a) / s;
  const Vector3d across = contact.d.cross(load.a) * (2.0 / s);
  const Vector3d tilting = load.a + (2.0 / s * cosine) * load.angular_gradient;
  subtract_M(lever * contact.d.transpose() - dB * across.transpose() + n_Q * tilting.transpose(),
             lever.dot(contact.d) + n_Q.dot(load.a));
  hessian.C -= (load.m / s) * (R * contact.d * dB.transpose() + cosine * (n * n_Q.transpose() - R));
}

}  // namespace wrenchd
