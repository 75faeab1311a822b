// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/contact.hpp"
#include "core/inertia.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The paper's numerical method (core/METHOD.md, section 7.4; paper, section 3.1): conjugate gradient from
/// the last admissible configuration. The paper uses it as the reference for its analytical family. It is
/// slow. With several active contacts it stops short of the optimum, because F is not differentiable there.
///
/// For each rotation the nearest admissible translation is known exactly. The only unknowns are the
/// exponential coordinates eta of the rotation, E <- E exp(eta), with the cost METHOD (56)
///
///   F(E) = min over admissible u of T(u, E)
///
/// and the gradient METHOD (57)
///
///   4 (w H v - v x H v) - sum m_i (c_i - x) x n_i
class Descent {
 public:
  /// Keeps a reference to `translations`; its translate() solves the inner problem. It must outlive this
  /// object.
  Descent(const Inertia& M, ExactProjection& translations) : M_(M), translations_(translations) {}

  /// Lowest-T configuration found from X_start; status `converged` if the gradient has vanished. Allocates
  /// nothing. Not RT-safe: takes about a hundred times as long as ExactProjection.
  Projection project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start) noexcept;

 private:
  Vector3d gradient(const Pose& X_WP, const Projection& at) const noexcept;

  Inertia M_;
  ExactProjection& translations_;
};

}  // namespace wrenchd
