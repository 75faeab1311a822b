// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/metric.hpp"

namespace wrenchd {

double energy(const Inertia& M, const Pose& X_WP, const Pose& X_WQ) noexcept {
  const Vector3d v = (X_WP.rotation.conjugate() * X_WQ.rotation).vec();
  const Vector3d s = X_WQ.translation_m - X_WP.translation_m;
  return M.mass_kg * s.squaredNorm() + 4.0 * v.dot(M.H_kg_m2 * v);
}

}  // namespace wrenchd
