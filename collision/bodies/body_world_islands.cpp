// SPDX-License-Identifier: GPL-3.0-or-later
// The poses of the bodies of a BodyWorld for known contacts: Newton's method for each island, core/METHOD.md,
// section 15.8.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {
namespace {

/// Most Newton steps of an island with Coulomb's friction, METHOD (106), and then most without friction.
constexpr int kNewtonSteps = 12;
/// Most Newton steps of an island if the work limit of the solver is reached.
constexpr int kLateSteps = 8;
/// After this number of Newton steps without an answer to Coulomb's law, the lifts of the cones stay as they
/// are.
constexpr int kUnanswered = 2;
/// A solve ends if no point moved farther than this in a Newton step [m]. It is small against the clearance.
constexpr double kConverged_m = 1e-10;
/// A solve that did not converge is accepted if its last Newton step moved no point farther than this [m].
constexpr double kAccepted_m = 1e-9;
/// Step of the differences for the curvature of a gap [m, rad].
constexpr double kDifference = 1e-6;

/// A U^-1 for an upper triangle U.
Matrix3d right_divided(const Matrix3d& A, const Matrix3d& U) noexcept {
  return U.transpose().triangularView<Eigen::Lower>().solve(A.transpose()).transpose();
}

}  // namespace

std::size_t BodyWorld::root_of(std::size_t body) noexcept {
  while (bodies_[body].island != body) body = bodies_[body].island = bodies_[bodies_[body].island].island;
  return body;
}

/// Bodies that a chain of contacts connects are one island.
void BodyWorld::find_islands() noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = i;
  for (const BodyContact& c : contacts_)
    if (c.b != BodyContact::kFixed) bodies_[root_of(c.b)].island = root_of(c.a);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (is_held(i)) bodies_[root_of(i)].island = root_of(bodies_[i].mover);
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = root_of(i);
}

/// Solves the islands with a body whose contacts changed.
void BodyWorld::solve_islands() noexcept {
  find_islands();
  for (std::size_t island = 0; island < bodies_.size(); ++island) {
    if (bodies_[island].island != island) continue;
    bool solved = true;
    double fraction = 1.0;  // the same time passes for all bodies of an island
    for (const Body& body : bodies_) {
      if (body.island != island) continue;
      solved = solved && body.solved;
      fraction = std::min(fraction, body.fraction);
    }
    if (solved) continue;
    for (;;) {
      for (Body& body : bodies_) {
        if (body.island != island || body.weight_per_s2 == 0.0) continue;
        body.fraction = fraction;
        set_goal(body);
      }
      if (solve_island(island)) break;
      fraction = shorter(fraction);
    }
  }
}

/// Solves an island. Returns false if Newton's method does not converge: the tick is then too long.
bool BodyWorld::solve_island(std::size_t island) noexcept {
  island_bodies_.clear();
  island_contacts_.clear();
  bool holding = false;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (bodies_[i].island != island || bodies_[i].weight_per_s2 == 0.0) continue;
    bodies_[i].solved = true;
    if (is_held(i)) {
      holding = true;
      continue;
    }
    bodies_[i].block = island_bodies_.size();
    island_bodies_.push_back(i);
  }
  for (std::size_t k = 0; k < contacts_.size(); ++k)
    if (bodies_[contacts_[k].a].island == island) island_contacts_.push_back(k);
  if (bodies_[island].fraction == 0.0) {
    for (const std::size_t k : island_contacts_) contacts_[k].force_W_N.setZero();
    for (Body& body : bodies_)
      if (body.island == island && body.weight_per_s2 > 0.0) hold(body);
    return true;
  }
  if (island_contacts_.empty() && !holding) {
    for (const std::size_t i : island_bodies_) bodies_[i].X_WQ = bodies_[i].X_goal;
    return true;
  }
  int unanswered = 0;
  for (int k = 0; k < kNewtonSteps; ++k) {
    const bool in_time = solver_steps_ < settings_.solver_steps;
    if (newton_step(in_time && unanswered < kUnanswered ? Friction::coulomb : Friction::frozen)) break;
    if (cones_status_ == ConeProjection::Status::budget_spent) ++unanswered;
    if (!in_time && k >= kLateSteps) break;
  }
  if (last_change_m_ <= kAccepted_m && admissible(island)) return true;
  for (int k = 0; k < kNewtonSteps; ++k)
    if (newton_step(Friction::none)) break;
  if (last_change_m_ <= kAccepted_m && admissible(island)) return true;
  for (Body& body : bodies_)
    if (body.island == island && body.weight_per_s2 > 0.0) body.X_WQ = body.motion.X_WB;
  return false;
}

/// True if the present poses of an island keep all its known contacts open.
bool BodyWorld::admissible(std::size_t island) const noexcept {
  return std::all_of(contacts_.begin(), contacts_.end(), [&](const BodyContact& c) {
    return bodies_[c.a].island != island || geometry(c).gap_m >= kMinClearance * kClearance_m;
  });
}

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
  const bool holding = moves_others(i);
  if (holding) add_held(i, gradient, metric);
  if (!is_tool(i) || !root_with_curvature(i, metric)) {
    if (holding) {
      body.root = metric.llt().matrixU();
    } else {
      body.root = Matrix6d::Zero();
      body.root.diagonal().head<3>() = metric.diagonal().head<3>().cwiseSqrt();
      body.root.bottomRightCorner<3, 3>() = Matrix3d(metric.bottomRightCorner<3, 3>()).llt().matrixU();
    }
  }
  body.root.transpose().triangularView<Eigen::Lower>().solveInPlace(gradient);
  return -gradient;
}

/// The root of the tool's metric less the curvature of its gaps times their loads, METHOD (113). Its loads
/// and levers are large against its spring, so without the curvature Newton's method converges slowly or not
/// at all. Returns false if that is not positive definite, also with the gradients of the gaps added, (40).
bool BodyWorld::root_with_curvature(std::size_t mover, const Matrix6d& metric) noexcept {
  Matrix6d W = metric, across = Matrix6d::Zero();
  for (const std::size_t k : island_contacts_) {
    const BodyContact& c = contacts_[k];
    const bool of_tool = moves_with(c.a, mover);
    if (of_tool == moves_with(c.b, mover)) continue;
    const double load_N = c.force_W_N.dot(geometry(c).n_W);
    if (!(load_N > 0.0)) continue;
    const Vector6d gradient = gap_gradient(mover, c, Vector6d::Zero());
    across += gradient * gradient.transpose();
    Matrix6d curvature;
    for (int axis = 0; axis < 6; ++axis) {
      const Vector6d step = kDifference * Vector6d::Unit(axis);
      curvature.col(axis) =
          (gap_gradient(mover, c, step) - gap_gradient(mover, c, -step)) / (2.0 * kDifference);
    }
    W -= 0.5 * load_N * (curvature + curvature.transpose());
    // Friction, at its point of the tool: METHOD (24) with the normal in its place
    const ContactGeometry at = geometry(c);
    const Pose X_TW = inverse(bodies_[mover].X_WQ);
    const Vector3d friction_W_N = c.force_W_N - load_N * at.n_W;
    const Vector3d f = X_TW.rotation * (of_tool ? friction_W_N : -friction_W_N), p = X_TW * at.point_W_m;
    W.bottomRightCorner<3, 3>() -=
        0.5 * (f * p.transpose() + p * f.transpose()) - f.dot(p) * Matrix3d::Identity();
  }
  double stiffening = 0.0;
  for (int attempt = 0; attempt < 4; ++attempt) {
    const Eigen::LLT<Matrix6d> llt(W + stiffening * across);
    if (llt.info() == Eigen::Success) {
      bodies_[mover].root = llt.matrixU();
      return true;
    }
    stiffening = stiffening == 0.0 ? 4.0 * W.lpNorm<Eigen::Infinity>() : 30.0 * stiffening;
  }
  return false;
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
    const Vector3d shift = step.head<3>(), turn = step.tail<3>();
    body.X_WQ.translation_m += shift;
    body.X_WQ.rotation = (body.X_WQ.rotation * rotation_from(turn)).normalized();
    double radius_m = body.radius_m;
    for (const Body& held : bodies_)
      if (held.mover == i && &held != &body) radius_m += held.X_MB.translation_m.norm() + held.radius_m;
    change_m = std::max(shift.norm() + radius_m * turn.norm(), change_m);
    if (is_tool(i)) move_held(i);
  }
  for (std::size_t k = 0; k < island_contacts_.size(); ++k) {
    BodyContact& contact = contacts_[island_contacts_[k]];
    contact.force_W_N = cones_.force(k);
    contact.active_normals = cones_.active_normals(k);
    if (contact.mu > 0.0 && friction == Friction::coulomb) contact.slip_m = cones_.lift_m(k) / contact.mu;
  }
  last_change_m_ = change_m;
  return change_m <= kConverged_m;
}

}  // namespace wrenchd
