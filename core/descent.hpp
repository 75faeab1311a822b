// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/contact.hpp"
#include "core/inertia.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The paper's numerical method (section 3.1): conjugate gradient in exponential coordinates from the last
/// admissible configuration. The reference that the paper measures its analytical family by; slow, and where
/// several contacts hold the optimum it stops short of it, because T has a kink there.
///
/// The translation is not searched: for each rotation the nearest admissible one is known exactly. So the
/// unknowns are the exponential coordinates eta of the rotation, E <- E exp(eta), and the cost is
///
///   F(E) = min over admissible u of T(u, E)
///
/// Its gradient is that of the Lagrangian (envelope theorem):  4 (w H v - v x H v) - sum m_i (c_i - x) x n_i.
class Descent {
 public:
  /// The projection is kept by reference: its translate() is the inner problem.
  Descent(const Inertia& M, ExactProjection& translations) : M_(M), translations_(translations) {}

  /// The least T it finds from X_start on. converged: the gradient has vanished. RT safe, but takes a hundred
  /// times what ExactProjection does.
  Projection project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start) noexcept;

 private:
  Vector3d gradient(const Pose& X_WP, const Projection& at) const noexcept;

  Inertia M_;
  ExactProjection& translations_;
};

}  // namespace wrenchd
