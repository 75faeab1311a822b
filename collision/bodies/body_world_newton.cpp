// SPDX-License-Identifier: GPL-3.0-or-later
// A Newton step of an island of a BodyWorld: core/METHOD.md, section 15.8.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {
namespace {

/// A solve ends if no point moved farther than this in a Newton step [m]. It is small against the clearance.
constexpr double kConverged_m = 1e-10;
/// Step of the differences for the curvature of a gap [m, rad].
constexpr double kDifference = 1e-6;
/// Attempts to make the metric of a tool positive definite, METHOD (40).
constexpr int kStiffenings = 4;
/// Least curvature of the tool's energy, as a fraction of that of its spring.
constexpr double kLeastRatio = 0.1;
/// Steps are extrapolated if the square of the cosine between them is larger than kAligned, and their ratio
/// than kSlow; at most by the multiple kFarthest.
constexpr double kAligned = 0.8, kSlow = 0.3, kFarthest = 20.0;

/// A U^-1 for an upper triangle U.
Matrix3d right_divided(const Matrix3d& A, const Matrix3d& U) noexcept {
  return U.transpose().triangularView<Eigen::Lower>().solve(A.transpose()).transpose();
}

/// The upper triangular root of the positive definite matrix that has the eigenvectors of W against the
/// metric, and the absolute values of its eigenvalues.
Matrix6d positive_root(const Matrix6d& W, const Matrix6d& metric) noexcept {
  const Matrix6d L = metric.llt().matrixL();
  const auto lower = L.triangularView<Eigen::Lower>();
  const Matrix6d half = lower.solve(W);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(Matrix6d(lower.solve(half.transpose())));
  const Matrix6d axes = L * eigen.eigenvectors();
  const Vector6d ratios = eigen.eigenvalues().cwiseAbs().cwiseMax(kLeastRatio);
  return Matrix6d(axes * ratios.asDiagonal() * axes.transpose()).llt().matrixU();
}

}  // namespace

/// The cone of a contact at q, METHOD (105), or its half-space without friction, METHOD (107).
FrictionCone BodyWorld::cone_of(const BodyContact& c, Friction friction) const noexcept {
  const ContactGeometry at = acting_geometry(c);
  FrictionCone cone;
  cone.n = at.n_W;
  cone.h_m = geometry(c).gap_m - c.hold_m;
  if (c.mu > 0.0 && friction != Friction::none) {
    cone.mu = c.mu;
    cone.slip_m = slip_m(c, at);
    cone.s_m = c.mu * c.slip_m;
  }
  const auto set_block = [&](std::size_t i, double sign, std::size_t& block, FrictionCone::Block& D) {
    const Body& body = bodies_[bodies_[i].mover];
    const Pose X_WB = is_held(i) ? acting_pose_of_mover(i) : acting_pose(i);
    const Vector3d arm_m =
        is_held(i) ? arm_of_held(i, at.point_W_m) : Vector3d(at.point_W_m - X_WB.translation_m);
    block = body.block;
    FrictionCone::Block moved;
    moved << sign * Matrix3d::Identity(), -sign * hat(arm_m) * X_WB.rotation.toRotationMatrix();
    // The upper triangle is inverted from the right, by blocks.
    const Matrix3d left = right_divided(moved.leftCols<3>(), body.root.topLeftCorner<3, 3>());
    D << left, right_divided(moved.rightCols<3>() - left * body.root.topRightCorner<3, 3>(),
                             body.root.bottomRightCorner<3, 3>());
  };
  set_block(c.a, 1.0, cone.a, cone.D_a);
  if (c.b != BodyContact::kFixed) set_block(c.b, -1.0, cone.b, cone.D_b);
  return cone;
}

/// Gradient of kappa T / 2 at q, METHOD (14), in the translation in W and the rotation in the body frame.
Vector6d BodyWorld::pull_gradient(const Body& body, const Pose& X_goal) noexcept {
  Quaterniond E = X_goal.rotation.conjugate() * body.X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() = -E.coeffs();
  const Vector3d v = E.vec(), Hv = body.M.H_kg_m2 * v;
  Vector6d gradient;
  gradient << body.weight_per_s2 * body.M.mass_kg * (body.X_WQ.translation_m - X_goal.translation_m),
      2.0 * body.weight_per_s2 * (E.w() * Hv - v.cross(Hv));
  return gradient;
}

/// The metric of a body at q, METHOD (15), with the factor kappa / 2.
Matrix6d BodyWorld::metric_of(const Body& body) noexcept {
  Quaterniond E = body.X_goal.rotation.conjugate() * body.X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() = -E.coeffs();
  const Matrix3d G = 0.5 * (E.w() * Matrix3d::Identity() + hat(E.vec()));
  Matrix6d metric = Matrix6d::Zero();
  metric.diagonal().head<3>().setConstant(body.weight_per_s2 * body.M.mass_kg);
  metric.bottomRightCorner<3, 3>() = 4.0 * body.weight_per_s2 * (G.transpose() * body.M.H_kg_m2 * G);
  return metric;
}

/// Sets the root of a body's metric at q. Returns the step without contacts, in coordinates in which the
/// metric is the identity.
Vector6d BodyWorld::descent(std::size_t i) noexcept {
  Body& body = bodies_[i];
  Vector6d gradient = pull_gradient(body, body.X_goal);
  Matrix6d metric = metric_of(body);
  if (moves_others(i)) add_held(i, gradient, metric);
  if (is_tool(i)) {
    set_root_with_curvature(i, metric);
  } else {
    body.root = Matrix6d::Zero();
    body.root.diagonal().head<3>() = metric.diagonal().head<3>().cwiseSqrt();
    body.root.bottomRightCorner<3, 3>() = Matrix3d(metric.bottomRightCorner<3, 3>()).llt().matrixU();
  }
  body.root.transpose().triangularView<Eigen::Lower>().solveInPlace(gradient);
  return -gradient;
}

/// Sets the root of the tool's metric less the curvature of its gaps times their loads, METHOD (113). Its
/// loads and levers are large against its spring, so without the curvature Newton's method converges slowly
/// or not at all.
void BodyWorld::set_root_with_curvature(std::size_t mover, const Matrix6d& metric) noexcept {
  Matrix6d W = metric, across = Matrix6d::Zero();
  for (const std::size_t k : island_contacts_) {
    BodyContact& c = contacts_[k];
    const bool of_tool = moves_with(c.a, mover);
    if (of_tool == moves_with(c.b, mover)) continue;
    const ContactGeometry at = geometry(c);
    const double load_N = c.force_W_N.dot(at.n_W);
    if (!(load_N > 0.0)) continue;
    if (c.b == BodyContact::kFixed) {
      const Vector6d gradient = gap_gradient(mover, c, Vector6d::Zero());
      across += gradient * gradient.transpose();
    }
    if (c.curvature_of != mover) set_curvature(mover, c);
    W -= load_N * c.curvature;
    // Friction, at its point of the tool: METHOD (24) with the normal in its place
    const Pose X_TW = inverse(bodies_[mover].X_WQ);
    const Vector3d friction_W_N = c.force_W_N - load_N * at.n_W;
    const Vector3d f = X_TW.rotation * (of_tool ? friction_W_N : -friction_W_N), p = X_TW * at.point_W_m;
    W.bottomRightCorner<3, 3>() -=
        0.5 * (f * p.transpose() + p * f.transpose()) - f.dot(p) * Matrix3d::Identity();
  }
  Matrix6d& root = bodies_[mover].root;
  double stiffening = 0.0;
  for (int attempt = 0; attempt < kStiffenings; ++attempt) {
    const Eigen::LLT<Matrix6d> llt(W + stiffening * across);
    if (llt.info() == Eigen::Success) {
      root = llt.matrixU();
      return;
    }
    stiffening = stiffening == 0.0 ? 4.0 * W.lpNorm<Eigen::Infinity>() : 30.0 * stiffening;
  }
  root = positive_root(W, metric);
}

/// The curvature of a gap of the tool, or of what it holds, at q. It hardly changes within a step.
void BodyWorld::set_curvature(std::size_t mover, BodyContact& c) const noexcept {
  Matrix6d differences;
  for (int axis = 0; axis < 6; ++axis) {
    const Vector6d step = kDifference * Vector6d::Unit(axis);
    differences.col(axis) =
        (gap_gradient(mover, c, step) - gap_gradient(mover, c, -step)) / (2.0 * kDifference);
  }
  c.curvature = 0.5 * (differences + differences.transpose());
  c.curvature_of = mover;
}

/// Gradient of a gap of the tool, or of what it holds, in the tool's translation in W and its rotation in T,
/// at a step from q.
Vector6d BodyWorld::gap_gradient(std::size_t mover, const BodyContact& c,
                                 const Vector6d& step) const noexcept {
  Pose X_WT = bodies_[mover].X_WQ;
  X_WT.translation_m += step.head<3>();
  X_WT.rotation = (X_WT.rotation * rotation_from(step.tail<3>())).normalized();
  const auto pose_of = [&](std::size_t i) {
    if (i == BodyContact::kFixed) return Pose{};
    if (i == mover) return X_WT;
    return moves_with(i, mover) ? X_WT * bodies_[i].X_MB : bodies_[i].X_WQ;
  };
  const ContactGeometry at = geometry_of(c, pose_of(c.a), pose_of(c.b));
  const Vector3d n_W = moves_with(c.a, mover) ? at.n_W : -at.n_W;
  Vector6d gradient;
  gradient << n_W, X_WT.rotation.conjugate() * (at.point_W_m - X_WT.translation_m).cross(n_W);
  return gradient;
}

/// Steps that fall, or alternate, by a constant factor point at the answer: goes there, core/METHOD.md,
/// section 15.8. Returns false if they do not.
bool BodyWorld::extrapolate() noexcept {
  double product = 0.0, before = 0.0, now = 0.0;
  for (const std::size_t i : island_bodies_) {
    const Body& body = bodies_[i];
    const auto in_metres = [&](Vector6d step) {
      step.tail<3>() *= body.radius_m;
      return step;
    };
    const Vector6d last = in_metres(body.newton_step), one_before = in_metres(body.newton_step_before);
    product += one_before.dot(last);
    before += one_before.squaredNorm();
    now += last.squaredNorm();
  }
  if (!(before > 0.0)) return false;
  const double ratio = product / before;
  if (!(product * product > kAligned * before * now) || !(std::abs(ratio) > kSlow)) return false;
  const double factor = std::clamp(ratio / (1.0 - ratio), -kFarthest, kFarthest);
  for (const std::size_t i : island_bodies_) move(i, factor * bodies_[i].newton_step);
  return true;
}

/// Moves q of a body, and of what it holds: by a translation in W and a rotation in the body frame.
void BodyWorld::move(std::size_t i, const Vector6d& step) noexcept {
  Body& body = bodies_[i];
  body.X_WQ.translation_m += step.head<3>();
  body.X_WQ.rotation = (body.X_WQ.rotation * rotation_from(step.tail<3>())).normalized();
  if (is_tool(i)) move_held(i);
}

/// One Newton step of an island, METHOD (99), (105). Returns true if it moved no point.
bool BodyWorld::newton_step(Friction friction) noexcept {
  cones_.clear(island_bodies_.size());
  for (const std::size_t i : island_bodies_) cones_.z0(bodies_[i].block) = descent(i);
  for (const std::size_t k : island_contacts_) {
    const BodyContact& contact = contacts_[k];
    for (const Vector3d& normal : contact.active_normals) cones_.suggest(cones_.cone_count(), normal);
    cones_.add(cone_of(contact, friction));
  }
  cones_status_ =
      friction == Friction::coulomb ? cones_.solve_coulomb(kTolerance_m) : cones_.solve(kTolerance_m);
  solver_steps_ += static_cast<std::uint32_t>(cones_.steps());
  double change_m = 0.0;
  for (const std::size_t i : island_bodies_) {
    Body& body = bodies_[i];
    const Vector6d step = body.root.triangularView<Eigen::Upper>().solve(cones_.z(body.block));
    body.newton_step_before = body.newton_step;
    body.newton_step = step;
    move(i, step);
    double radius_m = body.radius_m;
    for (const Body& held : bodies_)
      if (held.mover == i && &held != &body) radius_m += held.X_MB.translation_m.norm() + held.radius_m;
    change_m = std::max(step.head<3>().norm() + radius_m * step.tail<3>().norm(), change_m);
  }
  for (std::size_t k = 0; k < island_contacts_.size(); ++k) {
    BodyContact& contact = contacts_[island_contacts_[k]];
    contact.force_W_N = cones_.force(k);
    contact.active_normals = cones_.active_normals(k);
    if (contact.mu == 0.0 || friction == Friction::none) continue;
    const double slip_m = cones_.lift_m(k) / contact.mu;
    contact.slip_m = friction == Friction::coulomb ? slip_m : std::min(slip_m, contact.slip_m);
  }
  last_change_m_ = change_m;
  return change_m <= kConverged_m;
}

}  // namespace wrenchd
