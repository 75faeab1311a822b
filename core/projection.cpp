// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/projection.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// A gap this far below zero, in units of L, counts as closed: rounding of one rotation and one dot product.
constexpr double kGapTolerance = 2e-15;
/// A contact this near, in units of L, touches at q.
constexpr double kTouching = 1e-9;
/// Converged: the step left is this short, in units of L and rad, and the KKT residual this small before it
/// is taken.
constexpr double kShortStep = 1e-7;
constexpr double kSmallResidual = 1e-9;
/// Curvature of the Lagrangian, relative to the metric's, that a step may count on where there is less.
constexpr double kLeastCurvature = 1e-3;
/// The gradient of a penetration of half a millionth of L: below it, the residual is measured against this.
constexpr double kLeastGradient = 1e-6;
/// How many times the budget of a tick a query without history may take for each of its starts.
constexpr int kPatience = 5;
/// A dual bound this near to T, relative, proves that q is the global optimum.
constexpr double kProof = 1e-9;

Quaterniond turned(const Quaterniond& E, const Vector3d& eta) noexcept {
  // q o (1, eta/2) normalised: a retraction that agrees with exp to second order.
  const Quaterniond step(1.0, 0.5 * eta.x(), 0.5 * eta.y(), 0.5 * eta.z());
  return (E * step).normalized();
}

double positive_length(const Inertia& M) {
  const double squared = M.H_kg_m2.trace() / (2.0 * M.mass_kg);
  return squared > 0.0 ? std::sqrt(squared) : 1.0;
}

}  // namespace

ExactProjection::ExactProjection(const Inertia& M) : ExactProjection(M, Budget{}) {}

ExactProjection::ExactProjection(const Inertia& M, Budget budget)
    : M_(M),
      budget_(budget),
      iteration_limit_(budget.iterations),
      L_(positive_length(M)),
      H_hat_(M.H_kg_m2 / (M.mass_kg * L_ * L_)) {
  Matrix6d metric = Matrix6d::Zero();
  metric.diagonal().head<3>().setConstant(2.0);
  metric.bottomRightCorner<3, 3>() = 2.0 * H_hat_;
  metric_root_ = Eigen::LLT<Matrix6d>(metric).matrixL();
}

Projection ExactProjection::project(const Pose& X_WP, const ContactSource& scene,
                                    const Pose& X_start) noexcept {
  return project_from(X_WP, scene, (X_WP.rotation.conjugate() * X_start.rotation).normalized());
}

Projection ExactProjection::translate(const Pose& X_WP, const ContactSource& scene,
                                      const Pose& X_rotated) noexcept {
  const Quaterniond E = (X_WP.rotation.conjugate() * X_rotated.rotation).normalized();
  return project_from(X_WP, scene, E, Freedom::translation);
}

Projection ExactProjection::project_globally(const Pose& X_WP, const ContactSource& scene) noexcept {
  iteration_limit_ = static_cast<std::uint16_t>(kPatience * budget_.iterations);
  Projection best = best_of_all_starts(X_WP, scene);
  iteration_limit_ = budget_.iterations;
  return best;
}

Projection ExactProjection::best_of_all_starts(const Pose& X_WP, const ContactSource& scene) noexcept {
  Projection best = project_from(X_WP, scene, Quaterniond::Identity());
  if (best.status == ProjectionStatus::free) return best;
  best.proven_global = best.status != ProjectionStatus::infeasible && certify(state_);
  if (best.proven_global) return best;

  const auto try_from = [&](const Quaterniond& E) noexcept {
    Projection other = project_from(X_WP, scene, E);
    if (other.status == ProjectionStatus::infeasible) return;
    if (best.status != ProjectionStatus::infeasible && best.energy <= other.energy) return;
    other.proven_global = certify(state_);
    best = other;
  };

  const auto try_around = [&](const Quaterniond& centre, double angle) noexcept {
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) {
          if (best.proven_global || (x == 0 && y == 0 && z == 0)) continue;
          try_from(centre * Quaterniond(Eigen::AngleAxisd(angle, Vector3d(x, y, z).normalized())));
        }
  };

  // Where the dual bound is attained; then rotations about the axes of a cube's faces, edges and corners,
  // both ways, near and far from p; then the same around the best of these.
  try_from(Quaterniond(dual_rotation_));
  for (const double angle : {0.25, 0.6, 1.2, 2.2}) try_around(Quaterniond::Identity(), angle);
  const Quaterniond best_E = (X_WP.rotation.conjugate() * best.X_WQ.rotation).normalized();
  for (const double angle : {0.4, 0.9}) try_around(best_E, angle);
  return best;
}

// Rounding of the world coordinates counts too: a body far from the origin has coarser gaps.
double ExactProjection::gap_tolerance_m(const Pose& X_WT) const noexcept {
  return 4.0 * kGapTolerance * (L_ + X_WT.translation_m.lpNorm<Eigen::Infinity>());
}

Projection ExactProjection::project_from(const Pose& X_WP, const ContactSource& scene,
                                         const Quaterniond& E_start, Freedom freedom) noexcept {
  Projection out;
  out.X_WQ = X_WP;
  X_WP_ = X_WP;
  scene_ = &scene;
  tolerance_m_ = gap_tolerance_m(X_WP);
  contacts_.clear();
  iterations_ = 0;
  if (scene.add_violated(X_WP, tolerance_m_, contacts_) == 0) {
    out.proven_global = true;
    return out;
  }
  see_from(0);
  state_ = State{};
  state_.E = E_start;
  const Local local = freedom == Freedom::all ? minimise(state_) : translate_out(state_);
  out.iterations = iterations_;
  out.status = ProjectionStatus::infeasible;
  if (local == Local::infeasible) return out;
  out.status = local == Local::converged ? ProjectionStatus::converged : ProjectionStatus::budget_spent;
  report(out);
  return out;
}

Pose ExactProjection::pose_of(const State& state) const noexcept {
  return {(X_WP_.rotation * state.E).normalized(), X_WP_.translation_m + X_WP_.rotation * (L_ * state.u)};
}

/// Contacts number `first` and up as p sees them: n in p's axes, a and c in units of L.
void ExactProjection::see_from(std::size_t first) noexcept {
  const Quaterniond R_PW = X_WP_.rotation.conjugate();
  for (std::size_t i = first; i < contacts_.size(); ++i) {
    const Contact& contact = contacts_[i];
    seen_[i].n = R_PW * contact.n_W;
    seen_[i].a = contact.p_TA_m / L_;
    seen_[i].c = (contact.n_W.dot(X_WP_.translation_m) - contact.offset_m) / L_;
    multiplier_[i] = 0.0;
  }
}

double ExactProjection::scaled_energy(const State& state) const noexcept {
  const Vector3d v = state.E.vec();
  return state.u.squaredNorm() + 4.0 * v.dot(H_hat_ * v);
}

/// The nearest translation for the state's rotation, exactly:  min |u|^2  s.t.  n_i . u >= -(n_i . R_E a_i +
/// c_i), over all contacts of the scene by constraint generation: solve on the contacts at hand, ask the
/// scene what the answer violates, add it, repeat. Leaves the multipliers (2 u = sum 2 multiplier_i n_i).
/// False where no translation helps.
bool ExactProjection::restore(State& state) noexcept {
  using Status = LeastDistance<3, ContactSet::kCapacity>::Status;
  for (std::uint16_t round = 0; round < budget_.rounds; ++round) {
    translation_.clear();
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      const Seen& seen = seen_[i];
      translation_.add(seen.n, -(seen.n.dot(state.E * seen.a) + seen.c));
    }
    if (translation_.solve(Vector3d::Zero(), kGapTolerance) == Status::infeasible) return false;
    state.u = translation_.z();
    const std::size_t known = contacts_.size();
    if (scene_->add_violated(pose_of(state), tolerance_m_, contacts_) == 0) {
      state.T = scaled_energy(state);
      return true;
    }
    see_from(known);
  }
  return false;
}

/// Gaps and their gradients in (u, eta), eta the small rotation in the axes of q, for E <- E o (1, eta/2):
///
///   J_i = [ n_i ; a_i x R_E' n_i ]
void ExactProjection::linearise(const State& state) noexcept {
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const Seen& seen = seen_[i];
    const Vector3d n_Q = state.E.conjugate() * seen.n;
    J_[i] << seen.n, seen.a.cross(n_Q);
    gap_[i] = seen.n.dot(state.u) + n_Q.dot(seen.a) + seen.c;
  }
}

/// With G = (w I + v^)/2, so that dv = G eta:    g = [ 2 u ; 8 G' H^ v ]
Vector6d ExactProjection::gradient(const State& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Vector3d Hv = H_hat_ * v;
  Vector6d g;
  g << 2.0 * state.u, 4.0 * (state.E.w() * Hv - v.cross(Hv));
  return g;
}

/// Gradient of T and Hessian of the Lagrangian T - sum multiplier_i gap_i:
///
///   W   = diag( 2 I,  8 G' H^ G - 2 (v' H^ v) I - sum multiplier_i K_i )
///   K_i = (n a' + a n')/2 - (n . a) I,   n = R_E' n_i: the curvature of gap i, for R = I + eta^ + eta^^2/2
ExactProjection::Slope ExactProjection::slope(const State& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Matrix3d G = 0.5 * (state.E.w() * Matrix3d::Identity() + hat(v));
  Matrix3d W_eta = 8.0 * G.transpose() * H_hat_ * G - 2.0 * v.dot(H_hat_ * v) * Matrix3d::Identity();
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    if (!(multiplier_[i] > 0.0)) continue;
    const Vector3d n = state.E.conjugate() * seen_[i].n;
    const Matrix3d na = n * seen_[i].a.transpose();
    W_eta -= multiplier_[i] * (0.5 * (na + na.transpose()) - na.trace() * Matrix3d::Identity());
  }
  Slope out{gradient(state), Matrix6d::Zero()};
  out.W.diagonal().head<3>().setConstant(2.0);
  out.W.bottomRightCorner<3, 3>() = W_eta;
  return out;
}

/// W = C C' of the Hessian, made positive definite so that the step is a descent. Where the Hessian is not,
/// the active gradients are added first: that changes W only across the constraints, where the step is not
/// free, and keeps the convergence quadratic. If that is not enough (far from a minimum), negative
/// eigenvalues are turned over, taken relative to the metric diag(2 I, 2 H^): a needle's roll is a soft
/// direction, not a flat one.
Eigen::LLT<Matrix6d> ExactProjection::factorised(const Matrix6d& hessian) const noexcept {
  Eigen::LLT<Matrix6d> C(hessian);
  double stiffening = 4.0 * hessian.lpNorm<Eigen::Infinity>();
  for (int attempt = 0; C.info() != Eigen::Success && attempt < 3; ++attempt, stiffening *= 30.0) {
    Matrix6d W = hessian;
    for (std::size_t i = 0; i < contacts_.size(); ++i)
      if (multiplier_[i] > 0.0) W += stiffening * J_[i] * J_[i].transpose();
    C.compute(W);
  }
  if (C.info() == Eigen::Success) return C;
  const Matrix6d S = metric_root_.triangularView<Eigen::Lower>().solve(
      metric_root_.triangularView<Eigen::Lower>().solve(hessian).transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(S);
  const Vector6d turned_over = eigen.eigenvalues().cwiseAbs().cwiseMax(kLeastCurvature);
  const Matrix6d root = metric_root_ * eigen.eigenvectors();
  C.compute(root * turned_over.asDiagonal() * root.transpose());
  return C;
}

/// The step that minimises the quadratic model within the linearised gaps:
///
///   min 1/2 dy' W dy + g' dy   s.t.   J_i dy >= -gap_i
///
/// With W = C C' and z = C' dy this is a least-distance problem from z0 = -C^-1 g. At an admissible state dy
/// = 0 is allowed, so there always is an answer. Leaves the multipliers.
bool ExactProjection::newton_step(const Slope& slope, Vector6d& dy) noexcept {
  const Eigen::LLT<Matrix6d> C = factorised(slope.W);
  if (C.info() != Eigen::Success) return false;
  step_.clear();
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    step_.add(C.matrixL().solve(J_[i]), -std::max(gap_[i], 0.0));
  using Status = LeastDistance<6, ContactSet::kCapacity>::Status;
  if (step_.solve(-C.matrixL().solve(slope.g), kGapTolerance) != Status::optimal) return false;
  dy = C.matrixU().solve(step_.z());
  for (std::size_t i = 0; i < contacts_.size(); ++i) multiplier_[i] = step_.multiplier(i);
  return true;
}

ExactProjection::Local ExactProjection::translate_out(State& state) noexcept {
  if (!restore(state)) return Local::infeasible;
  for (std::size_t i = 0; i < contacts_.size(); ++i) multiplier_[i] = 2.0 * translation_.multiplier(i);
  return Local::converged;
}

/// Newton's method on the contacts at hand, from the state's rotation. Every accepted state is admissible for
/// them.
ExactProjection::Local ExactProjection::minimise(State& state) noexcept {
  if (translate_out(state) == Local::infeasible) {
    if (!seek_feasible(state)) return Local::infeasible;
    translate_out(state);
  }
  while (iterations_ < iteration_limit_) {
    ++iterations_;
    make_room(state);
    linearise(state);
    const Slope here = slope(state);
    Vector6d dy;
    if (!newton_step(here, dy)) return Local::budget_spent;
    const double promised = -here.g.dot(dy);  // first-order fall of T
    const bool last = dy.norm() < kShortStep && residual(here.g) < kSmallResidual;
    const Advance moved = advance(state, dy, promised);
    if (moved == Advance::met_contacts) continue;  // the same state again, with a model that knows them
    if (last) return Local::converged;
    // Rounding hides the fall of T where the promise is smaller than T's own last digits.
    if (moved == Advance::stuck) return promised <= 1e-13 * state.T ? Local::converged : Local::budget_spent;
  }
  return Local::budget_spent;
}

/// |g - sum multiplier_i J_i| / |g|, at the state that was linearised last.
double ExactProjection::residual(const Vector6d& g) const noexcept {
  Vector6d rest = g;
  for (std::size_t i = 0; i < contacts_.size(); ++i) rest -= multiplier_[i] * J_[i];
  return rest.norm() / std::max(g.norm(), kLeastGradient);
}

/// Moves along dy, halving it until T falls by a fair share of what the slope promises. A trial that fails
/// and has met contacts the model did not know ends the search: with them the next step will be a better one.
ExactProjection::Advance ExactProjection::advance(State& state, const Vector6d& dy,
                                                  double promised) noexcept {
  constexpr double kFairShare = 1e-4;  // Armijo's constant, the usual value
  constexpr int kHalvings = 20;        // below a millionth of a step the model is not to be trusted
  const Vector3d turn = dy.tail<3>();
  const double rounding = dy.norm() < kShortStep ? 1e-14 * state.T : 0.0;
  double fraction = 1.0 / std::max(1.0, turn.norm());  // never more than one radian at a time
  for (int halving = 0; halving < kHalvings; ++halving, fraction *= 0.5) {
    State trial = state;
    trial.E = turned(state.E, fraction * turn);
    const std::size_t known = contacts_.size();
    if (restore(trial) && trial.T <= state.T + rounding - kFairShare * fraction * promised) {
      state = trial;
      return Advance::fell;
    }
    if (contacts_.size() > known) return Advance::met_contacts;
  }
  return Advance::stuck;
}

/// Looks for a rotation from which a translation leads out, by Gauss-Newton on the deepest violation t:
///
///   min  t^2 + small |dy|^2   s.t.   J_i dy + t >= -gap_i
///
/// a least-distance problem in seven dimensions that always has an answer.
bool ExactProjection::seek_feasible(State& state) noexcept {
  constexpr double kRegularisation = 1e-3;  // weight of dy against t: small, so that t is what falls
  constexpr int kSteps = 30;
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  for (int step = 0; step < kSteps; ++step) {
    linearise(state);
    elastic_.clear();
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      Vector7d row;
      row << J_[i] / kRegularisation, 1.0;
      elastic_.add(row, -gap_[i]);
    }
    using Status = LeastDistance<7, ContactSet::kCapacity>::Status;
    if (elastic_.solve(Vector7d::Zero(), kGapTolerance) == Status::infeasible) return false;
    Vector6d dy = elastic_.z().head<6>() / kRegularisation;
    const double largest_turn = dy.tail<3>().norm();
    if (largest_turn > 0.5) dy *= 0.5 / largest_turn;
    if (dy.norm() < kShortStep) return false;
    state.u += dy.head<3>();
    state.E = turned(state.E, dy.tail<3>());
    if (restore(state)) return true;
  }
  return false;
}

/// Drops contacts that carry nothing and do not touch, once the set is more than half full, so that new ones
/// fit in.
void ExactProjection::make_room(const State& state) noexcept {
  if (contacts_.size() <= ContactSet::kCapacity / 2) return;
  linearise(state);
  for (std::size_t i = contacts_.size(); i-- > 0;) {
    if (multiplier_[i] > 0.0 || gap_[i] < kTouching) continue;
    contacts_.remove_unordered(i);
    const std::size_t last = contacts_.size();
    seen_[i] = seen_[last];
    multiplier_[i] = multiplier_[last];
    gap_[i] = gap_[last];
  }
}

/// Fills in what is known of the answer: energy, contacts that touch with their multipliers, and the
/// residual.
void ExactProjection::report(Projection& out) noexcept {
  out.X_WQ = pose_of(state_);
  linearise(state_);
  out.kkt_residual = residual(gradient(state_));
  out.energy = energy(M_, X_WP_, out.X_WQ);
  out.active_count = 0;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    if (gap_[i] > kTouching) continue;
    out.active[out.active_count++] = {contacts_[i], multiplier_[i] * M_.mass_kg * L_};
  }
}

// Weak duality gives a proof of global optimality for the price of a 4 x 4 eigenvalue problem. For any
// multipliers >= 0, the least value of the Lagrangian over all u and all unit quaternions q bounds T from
// below. A vertex-face gap is quadratic in q, n . R(q) a = q' A q with
//
//   A = [ n.a      (a x n)'              ]
//       [ a x n    n a' + a n' - (n.a) I ]
//
// so the bound is  -sum m_i c_i - |sum m_i n_i|^2 / 4 + lambda_min( 4 diag(0, H^) - sum m_i A_i ),
// and where it meets T no admissible pose is closer.
bool ExactProjection::certify(const State& state) noexcept {
  Eigen::Matrix4d Z = Eigen::Matrix4d::Zero();
  Z.bottomRightCorner<3, 3>() = 4.0 * H_hat_;
  Vector3d pull = Vector3d::Zero();
  double bound = 0.0;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const double m = multiplier_[i];
    if (!(m > 0.0)) continue;
    const auto& [n, a, c] = seen_[i];
    const Vector3d an = a.cross(n);
    const Matrix3d na = n * a.transpose();
    Z(0, 0) -= m * n.dot(a);
    Z.topRightCorner<1, 3>() -= m * an.transpose();
    Z.bottomLeftCorner<3, 1>() -= m * an;
    Z.bottomRightCorner<3, 3>() -= m * (na + na.transpose() - n.dot(a) * Matrix3d::Identity());
    pull += m * n;
    bound -= m * c;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(Z);
  const Eigen::Vector4d q = eigen.eigenvectors().col(0);
  dual_rotation_ = Quaterniond(q[0], q[1], q[2], q[3]);
  bound += eigen.eigenvalues()[0] - 0.25 * pull.squaredNorm();
  return state.T - bound <= kProof * std::max(state.T, 1e-12);
}

}  // namespace wrenchd
