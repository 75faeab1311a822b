// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/projection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/optimality_certificate.hpp"

namespace wrenchd {
namespace {

/// A gap down to minus this value, in units of L, counts as closed: rounding of one rotation and one dot
/// product.
constexpr double kGapTolerance = 2e-15;
/// Between opposite contacts only one translation may be left, and rounding could remove it. Then contacts
/// with a clearance may violate it by this share.
constexpr double kSlack = 1e-3;
/// A contact with at most this gap, in units of L, touches at q.
constexpr double kTouching = 1e-9;
/// Convergence: length of the remaining step, in units of L and rad, and KKT residual before that step.
constexpr double kShortStep = 1e-7;
constexpr double kSmallResidual = 2e-10;
/// If a short step no longer halves the residual, the rest is rounding if it is below this value. Contacts
/// with nearly dependent normals, as in a bore, amplify the rounding of the gaps.
constexpr double kRoundedResidual = 5e-7;
/// Least curvature of the Lagrangian, relative to the metric, that a step assumes.
constexpr double kMinCurvature = 1e-3;
/// Gradient of a penetration of half a millionth of L: lower bound of the denominator of the residual.
constexpr double kMinGradient = 1e-6;
/// Above this number of contacts, contacts without load are dropped.
constexpr std::size_t kMaxIdleContacts = 24;
/// Factor on the iteration limit for each start of a query without history.
constexpr int kStartBudgetFactor = 5;

double positive_length(const Inertia& M) {
  const double squared = M.H_kg_m2.trace() / (2.0 * M.mass_kg);
  return squared > 0.0 ? std::sqrt(squared) : 1.0;
}

}  // namespace

StaticVector<ActiveContact, ContactSet::kCapacity> evenly_loaded_contacts(
    const Projection& projection) noexcept {
  StaticVector<ActiveContact, ContactSet::kCapacity> balanced;
  for (const ActiveContact& a : projection.active) {
    double count = 0.0;
    double load = 0.0;
    for (const ActiveContact& b : projection.active) {
      if (b.contact.obstacle != a.contact.obstacle) continue;
      count += 1.0;
      load += b.multiplier;
    }
    balanced.add({a.contact, load / count});
  }
  return balanced;
}

ExactProjection::ExactProjection(const Inertia& M) : ExactProjection(M, Budget{}) {}

ExactProjection::ExactProjection(const Inertia& M, Budget budget, double clearance_m)
    : M_(M),
      budget_(budget),
      iteration_limit_(budget.iterations),
      L_(positive_length(M)),
      clearance_(clearance_m / L_),
      gap_slack_(std::max(kGapTolerance, kSlack * clearance_)),
      H_hat_(M.H_kg_m2 / (M.mass_kg * L_ * L_)) {
  Matrix6d metric = Matrix6d::Zero();
  metric.diagonal().head<3>().setConstant(2.0);
  metric.bottomRightCorner<3, 3>() = 2.0 * H_hat_;
  metric_root_ = Eigen::LLT<Matrix6d>(metric).matrixL();
}

Projection ExactProjection::project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start,
                                    std::span<const ActiveContact> known) noexcept {
  begin_query(X_WP, scene);
  return known.empty() ? solve(relative_rotation(X_start.rotation)) : solve_from_known(X_start, known);
}

Projection ExactProjection::step(const Pose& X_WP, const Pose& X_start, std::span<const ActiveContact> known,
                                 const StepLimit& limit) noexcept {
  /// All contacts are known: the scene has none.
  class Nothing final : public ContactSource {
   public:
    std::size_t add_violated(const Pose&, double, ContactSet&) const noexcept override { return 0; }
    void add_touching(const Pose&, double, ContactSet&) const noexcept override {}
    bool admits(const Pose&, double) const noexcept override { return true; }
  };
  const Nothing nothing;
  begin_query(X_WP, nothing);
  const bool free_at_p = load_known_contacts(known);
  iterations_ = 0;
  touching_added_ = false;
  step_start_ = to_iterate(X_start);
  step_limit_ = limit;
  state_ = Iterate{};
  if (free_at_p && !exceeds_step_limit(state_)) {
    step_limit_ = StepLimit{};
    return free_projection();
  }
  state_ = step_start_;
  if (contacts_.empty()) {  // no contacts: straight towards p
    const double turn_rad = step_start_.E.angularDistance(Quaterniond::Identity());
    const double share =
        std::min(limit.translation_m / std::max(step_start_.u.norm() * L_, limit.translation_m),
                 limit.rotation_rad / std::max(turn_rad, limit.rotation_rad));
    state_.E = step_start_.E.slerp(share, Quaterniond::Identity());
    state_.R = state_.E.toRotationMatrix();
    state_.u = (1.0 - share) * step_start_.u;
    state_.T = scaled_energy(state_);
    residual_ = 1.0;
    step_limit_ = StepLimit{};
    return make_projection(LocalResult::budget_spent);
  }
  // A tool between two obstacles may have to rotate. In all other cases the rotation of X_start is
  // admissible.
  const bool may_rotate = limit.rotation_rad == std::numeric_limits<double>::infinity();
  if (!translate(state_) && !(may_rotate && find_feasible_rotation(state_))) {
    step_limit_ = StepLimit{};
    return make_projection(LocalResult::infeasible);
  }
  LocalResult local = LocalResult::budget_spent;
  if (exceeds_step_limit(state_)) {
    // At a fixed rotation the gaps are affine and T is convex: the straight path to the nearest translation
    // is admissible, and T falls along it.
    const Vector3d path = state_.u - step_start_.u;
    state_.u = step_start_.u + path * (limit.translation_m / (L_ * path.norm()));
    state_.T = scaled_energy(state_);
    linearise(state_);
    residual_ = residual(gradient(state_));
  } else {
    local = minimise(state_, false);
  }
  step_limit_ = StepLimit{};
  return make_projection(local);
}

/// With z0 = -g and the rows J_i . z >= 0 the answer of (31) is z = -g + sum multiplier_i J_i.
void ExactProjection::balance(const Pose& X_WP, Projection& q) noexcept {
  X_WP_ = X_WP;
  load_known_contacts({q.active.begin(), q.active.end()});
  state_ = to_iterate(q.X_WQ);
  linearise(state_);
  const Vector6d g = gradient(state_);
  newton_problem_.clear();
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (gap_[i] <= kTouching) newton_problem_.add(J_[i], 0.0);
  using Status = LeastDistance<6, ContactSet::kCapacity>::Status;
  const bool solved = newton_problem_.solve(-g, kGapTolerance) == Status::optimal;
  q.active.clear();
  std::size_t row = 0;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const bool touches = gap_[i] <= kTouching;
    multiplier_[i] = touches && solved ? newton_problem_.multiplier(row) : 0.0;
    row += touches ? 1 : 0;
    q.active.add({contacts_[i], multiplier_[i] * M_.mass_kg * L_});
  }
  q.kkt_residual = residual(g);
}

/// True if a state is beyond the step limit.
bool ExactProjection::exceeds_step_limit(const Iterate& state) const noexcept {
  return (state.u - step_start_.u).norm() * L_ > step_limit_.translation_m ||
         state.E.angularDistance(step_start_.E) > step_limit_.rotation_rad;
}

Projection ExactProjection::translate(const Pose& X_WP, const ContactSource& scene,
                                      const Pose& X_rotated) noexcept {
  begin_query(X_WP, scene);
  return solve(relative_rotation(X_rotated.rotation), Freedom::translation);
}

Projection ExactProjection::project_globally(const Pose& X_WP, const ContactSource& scene) noexcept {
  iteration_limit_ = static_cast<std::uint16_t>(kStartBudgetFactor * budget_.iterations);
  begin_query(X_WP, scene);
  Projection best = multistart();
  iteration_limit_ = budget_.iterations;
  return best;
}

Projection ExactProjection::multistart() noexcept {
  Projection best = solve(Quaterniond::Identity());
  if (best.status == ProjectionStatus::free) return best;
  best.proven_global = best.status == ProjectionStatus::converged && certify_global();
  if (best.proven_global) return best;
  const Quaterniond dual_optimum = best.status == ProjectionStatus::infeasible
                                       ? Quaterniond::Identity()
                                       : dual_rotation(H_hat_, {local_contacts_.data(), contacts_.size()},
                                                       {multiplier_.data(), contacts_.size()});

  const auto try_from = [&](const Quaterniond& E) noexcept {
    Projection other = solve(E);
    if (other.status == ProjectionStatus::infeasible) return;
    if (best.status != ProjectionStatus::infeasible && best.energy <= other.energy) return;
    other.proven_global = other.status == ProjectionStatus::converged && certify_global();
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

  // First the rotation at which the dual bound is attained; then rotations about the 26 directions of a
  // cube's faces, edges and corners, at several angles from p; then the same around the best result.
  try_from(dual_optimum);
  for (const double angle : {0.25, 0.6, 1.2, 2.2}) try_around(Quaterniond::Identity(), angle);
  const Quaterniond best_E = relative_rotation(best.X_WQ.rotation);
  for (const double angle : {0.4, 0.9}) try_around(best_E, angle);
  return best;
}

// Includes the rounding of world coordinates, which grows with the distance from the origin.
double ExactProjection::gap_tolerance_m(const Pose& X_WT) const noexcept {
  return 4.0 * kGapTolerance * (L_ + X_WT.translation_m.lpNorm<Eigen::Infinity>());
}

/// Prepares a query at one p.
void ExactProjection::begin_query(const Pose& X_WP, const ContactSource& scene) noexcept {
  X_WP_ = X_WP;
  scene_ = &scene;
  at_step_limit_ = false;
  rounding_m_ = gap_tolerance_m(X_WP);
  tolerance_m_ = rounding_m_ - clearance_ * L_;
}

Quaterniond ExactProjection::relative_rotation(const Quaterniond& R_WT) const noexcept {
  return (X_WP_.rotation.conjugate() * R_WT).normalized();
}

/// Returns a pose in scaled coordinates.
ExactProjection::Iterate ExactProjection::to_iterate(const Pose& X_WT) const noexcept {
  Iterate state;
  state.E = relative_rotation(X_WT.rotation);
  state.R = state.E.toRotationMatrix();
  state.u = X_WP_.rotation.conjugate() * (X_WT.translation_m - X_WP_.translation_m) / L_;
  state.T = scaled_energy(state);
  return state;
}

/// Solves without history, from the contacts that p violates.
Projection ExactProjection::solve(const Quaterniond& E_start, Freedom freedom) noexcept {
  if (scene_->admits(X_WP_, tolerance_m_)) return free_projection();
  contacts_.clear();
  scene_->add_violated(X_WP_, tolerance_m_, contacts_);
  update_local_contacts(0);
  iterations_ = 0;
  touching_added_ = false;
  state_ = Iterate{};
  state_.E = E_start;
  state_.R = E_start.toRotationMatrix();
  if (freedom == Freedom::translation)
    return make_projection(project_translation(state_) ? LocalResult::converged : LocalResult::infeasible);
  return make_projection(project_translation_or_rotate(state_) ? minimise(state_, true)
                                                               : LocalResult::infeasible);
}

/// Loads the known contacts and their multipliers. Returns true if p violates none of them.
bool ExactProjection::load_known_contacts(std::span<const ActiveContact> known) noexcept {
  contacts_.clear();
  for (const ActiveContact& active : known) contacts_.add(active.contact);
  update_local_contacts(0);
  bool apart = true;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    multiplier_[i] = known[i].multiplier / (M_.mass_kg * L_);
    apart = apart && !gap_at_p_below(local_contacts_[i], -tolerance_m_ / L_);
  }
  return apart;
}

/// Solves from an admissible pose and its contacts. Usually a known contact shows without a scene query that
/// p is not admissible.
Projection ExactProjection::solve_from_known(const Pose& X_start,
                                             std::span<const ActiveContact> known) noexcept {
  if (load_known_contacts(known) && scene_->admits(X_WP_, tolerance_m_)) return free_projection();
  iterations_ = 0;
  touching_added_ = false;
  state_.E = relative_rotation(X_start.rotation);
  state_.R = state_.E.toRotationMatrix();
  if (translate(state_)) return make_projection(minimise(state_, false));
  return make_projection(project_translation_or_rotate(state_) ? minimise(state_, true)
                                                               : LocalResult::infeasible);
}

Projection ExactProjection::free_projection() const noexcept {
  Projection out;
  out.X_WQ = X_WP_;
  out.proven_global = true;
  return out;
}

/// Makes the projection of the current state.
Projection ExactProjection::make_projection(LocalResult local) noexcept {
  Projection out;
  out.X_WQ = X_WP_;
  out.iterations = iterations_;
  out.status = ProjectionStatus::infeasible;
  if (local == LocalResult::infeasible) return out;
  out.status = local == LocalResult::converged ? ProjectionStatus::converged : ProjectionStatus::budget_spent;
  fill_projection(out);
  return out;
}

Pose ExactProjection::to_pose(const Iterate& state) const noexcept {
  return {(X_WP_.rotation * state.E).normalized(), X_WP_.translation_m + X_WP_.rotation * (L_ * state.u)};
}

/// Transforms the contacts from index `first` on to the axes of p and units of L, METHOD (20).
void ExactProjection::update_local_contacts(std::size_t first) noexcept {
  if (first == contacts_.size()) return;
  const Matrix3d R_PW = X_WP_.rotation.toRotationMatrix().transpose();
  for (std::size_t i = first; i < contacts_.size(); ++i) {
    make_local(contacts_[i], X_WP_, R_PW, L_, local_contacts_[i]);
    multiplier_[i] = 0.0;
  }
}

double ExactProjection::scaled_energy(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  return state.u.squaredNorm() + 4.0 * v.dot(H_hat_ * v);
}

/// E <- E o (1, eta/2), normalized: a retraction that agrees with exp to second order, METHOD (13).
void ExactProjection::rotate(Iterate& state, const Vector3d& eta) const noexcept {
  const Quaterniond step(1.0, 0.5 * eta.x(), 0.5 * eta.y(), 0.5 * eta.z());
  state.E = (state.E * step).normalized();
  state.R = state.E.toRotationMatrix();
}

/// The nearest translation for the rotation of the state over the known contacts, METHOD (36): min |u|^2 s.t.
/// n_i . u >= -h_i. Returns false if no translation is admissible.
bool ExactProjection::translate(Iterate& state) noexcept {
  translation_problem_.clear();
  return extend_translation(state);
}

/// Solves the translation problem again with the contacts added since.
bool ExactProjection::extend_translation(Iterate& state) noexcept {
  using Status = LeastDistance<3, ContactSet::kCapacity>::Status;
  for (std::size_t i = translation_problem_.count(); i < contacts_.size(); ++i) {
    const AffineGap gap = affine_gap(local_contacts_[i], state.R, clearance_);
    translation_problem_.add_unit(gap.n, -gap.h);
  }
  E_translated_ = state.E;
  if (translation_problem_.solve(Vector3d::Zero(), kGapTolerance) == Status::infeasible &&
      (gap_slack_ == kGapTolerance ||
       translation_problem_.solve(Vector3d::Zero(), gap_slack_) == Status::infeasible))
    return false;
  state.u = translation_problem_.z();
  state.T = scaled_energy(state);
  return true;
}

/// The nearest translation over all contacts of the scene by constraint generation: solves for the known
/// contacts, adds those that the solution violates, and repeats. Contacts without load may be dropped: |u|
/// increases from round to round, so no cycle is possible. Returns false if no translation is admissible or
/// the rounds are used up.
bool ExactProjection::restore_admissibility(Iterate& state) noexcept {
  translation_problem_.clear();
  for (std::uint16_t round = 0; round < budget_.constraint_rounds; ++round) {
    if (!extend_translation(state)) return false;
    if (contacts_.size() > kMaxIdleContacts) drop_idle_contacts(state);
    const std::size_t known = contacts_.size();
    if (scene_->add_violated(to_pose(state), tolerance_m_, contacts_) == 0)
      return !contacts_.full();  // a full set may lack further violated contacts
    update_local_contacts(known);
  }
  return false;
}

// Gaps and gradients of all contacts, METHOD (22).
void ExactProjection::linearise(const Iterate& state) noexcept {
  // Usually translation_problem_ has this rotation already.
  const bool known =
      translation_problem_.count() == contacts_.size() && E_translated_.coeffs() == state.E.coeffs();
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const LocalContact& contact = local_contacts_[i];
    const AffineGap at = known ? AffineGap{translation_problem_.normal(i), -translation_problem_.bound(i)}
                               : affine_gap(contact, state.R, clearance_);
    gap_[i] = at.n.dot(state.u) + at.h;
    J_[i] = gap_gradient(contact, at.n, gap_[i] + clearance_, state.u, state.R);
  }
}

/// METHOD (14), with G = (w I + v^)/2, so that dv = G eta: g = [ 2 u ; 8 G' H^ v ]
Vector6d ExactProjection::gradient(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Vector3d Hv = H_hat_ * v;
  Vector6d g;
  g.head<3>() = 2.0 * state.u;
  g.tail<3>() = 4.0 * (state.E.w() * Hv - v.cross(Hv));
  return g;
}

/// Hessian of T, METHOD (15): [ 2 I, 0; 0, 8 G' H^ G - 2 (v' H^ v) I ]
HessianBlocks ExactProjection::metric_hessian(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Matrix3d G = 0.5 * (state.E.w() * Matrix3d::Identity() + hat(v));
  HessianBlocks W;
  W.B = 8.0 * G.transpose() * H_hat_ * G;
  W.B.diagonal().array() -= 2.0 * v.dot(H_hat_ * v);
  return W;
}

/// Hessian of the Lagrangian T - sum multiplier_i gap_i, METHOD (38). The gap curvature is linear in a, b and
/// J, so contacts with the same normal are summed first.
HessianBlocks ExactProjection::lagrangian_hessian(const Iterate& state) const noexcept {
  HessianBlocks W = metric_hessian(state);
  const auto carries = [&](std::size_t i) { return multiplier_[i] > 0.0; };
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const auto is_of_i = [&](std::size_t j) { return carries(j) && same_normal(contacts_[i], contacts_[j]); };
    if (!carries(i)) continue;
    bool done = false;
    for (std::size_t j = 0; j < i; ++j) done = done || is_of_i(j);
    if (done) continue;
    WeightedContactSum load;
    for (std::size_t j = i; j < contacts_.size(); ++j) {
      if (!is_of_i(j)) continue;
      load.m += multiplier_[j];
      load.a += multiplier_[j] * local_contacts_[j].a;
      load.b += multiplier_[j] * local_contacts_[j].b;
      load.angular_gradient += multiplier_[j] * J_[j].tail<3>();
    }
    subtract_gap_curvature(local_contacts_[i], J_[i].head<3>(), load, state.u, state.R, W);
  }
  return W;
}

/// Makes the Hessian positive definite, so that the step is a descent, METHOD (40). First it adds the active
/// gradients. They change the Hessian only across the constraints, so convergence stays quadratic. If that is
/// not enough, it replaces negative eigenvalues, relative to the metric diag(2 I, 2 H^), by their absolute
/// values.
void ExactProjection::factorise_convexified(const HessianBlocks& curvature,
                                            CholeskyFactor& root) const noexcept {
  Matrix6d W;
  W << 2.0 * Matrix3d::Identity(), curvature.C, curvature.C.transpose(), curvature.B;
  Matrix6d L;
  const auto split = [&](const Matrix6d& A) {
    const Eigen::LLT<Matrix6d> llt(A);
    if (llt.info() != Eigen::Success) return false;
    L = llt.matrixL();
    const Matrix3d P = L.topLeftCorner<3, 3>();
    const Matrix3d S = L.bottomRightCorner<3, 3>();
    root.P_inverse = P.triangularView<Eigen::Lower>().solve(Matrix3d::Identity());
    root.S_inverse = S.triangularView<Eigen::Lower>().solve(Matrix3d::Identity());
    root.Q = L.bottomLeftCorner<3, 3>();
    return true;
  };
  double stiffening = 4.0 * W.lpNorm<Eigen::Infinity>();
  for (int attempt = 0; attempt < 3; ++attempt, stiffening *= 30.0) {
    Matrix6d stiffened = W;
    for (std::size_t i = 0; i < contacts_.size(); ++i)
      if (multiplier_[i] > 0.0) stiffened += stiffening * J_[i] * J_[i].transpose();
    if (split(stiffened)) return;
  }
  const Matrix6d scaled = metric_root_.triangularView<Eigen::Lower>().solve(
      metric_root_.triangularView<Eigen::Lower>().solve(W).transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scaled);
  const Vector6d turned_over = eigen.eigenvalues().cwiseAbs().cwiseMax(kMinCurvature);
  const Matrix6d factor = metric_root_ * eigen.eigenvectors();
  if (split(factor * turned_over.asDiagonal() * factor.transpose())) return;
  split(metric_root_ * metric_root_.transpose());
}

/// Factorises the Hessian of the Lagrangian.
///
/// The first multipliers come from a pure translation and may be too large. If they make the Hessian
/// indefinite, the first steps use the Hessian of T alone.
void ExactProjection::factorise_model(const Iterate& state) noexcept {
  constexpr int kEarly = 2;
  const HessianBlocks W = lagrangian_hessian(state);
  if (factorise(W, factor_)) return;
  if (iterations_ > kEarly || !factorise(metric_hessian(state), factor_)) factorise_convexified(W, factor_);
}

/// Step dy that minimizes the quadratic model within the linearised gaps, METHOD (37):
///
///   min 1/2 dy' W dy + g' dy   s.t.   J_i dy >= -gap_i
///
/// With W = root root' and z = root' dy this is a least-distance problem from z0 = -root^-1 g, METHOD (39).
/// At an admissible state dy = 0 is feasible, so a solution exists. Updates the multipliers.
bool ExactProjection::newton_step(const Vector6d& g, Vector6d& dy) noexcept {
  newton_problem_.clear();
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    newton_problem_.add(factor_.solve(J_[i]), -std::max(gap_[i], 0.0));
  using Status = LeastDistance<6, ContactSet::kCapacity>::Status;
  if (newton_problem_.solve(-factor_.solve(g), kGapTolerance) != Status::optimal) return false;
  dy = factor_.solve_transposed(newton_problem_.z());
  for (std::size_t i = 0; i < contacts_.size(); ++i) multiplier_[i] = newton_problem_.multiplier(i);
  return true;
}

/// Nearest admissible translation with its multipliers.
bool ExactProjection::project_translation(Iterate& state) noexcept {
  if (!restore_admissibility(state)) return false;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    multiplier_[i] = 2.0 * translation_problem_.multiplier(i);
  linearise(state);
  residual_ = residual(gradient(state));
  return true;
}

/// Nearest admissible translation, after a rotation if there is none at the current rotation.
bool ExactProjection::project_translation_or_rotate(Iterate& state) noexcept {
  return project_translation(state) || (find_feasible_rotation(state) && project_translation(state));
}

/// Newton's method from a state and first multipliers; leaves the gaps of the last state. scene_asked: the
/// scene was queried for this state and is queried for each next one. Following a proxy starts without: until
/// the known contacts give a result or one of them loses its load, they count as all contacts.
ExactProjection::LocalResult ExactProjection::minimise(Iterate& state, bool scene_asked) noexcept {
  // KKT residual before the last short step
  double before_short_step = std::numeric_limits<double>::infinity();
  for (;;) {
    linearise(state);
    const Vector6d g = gradient(state);
    residual_ = residual(g);
    const bool rounding = residual_ > 0.5 * before_short_step && residual_ <= kRoundedResidual;
    const bool converged = residual_ <= kSmallResidual || rounding;
    if (converged || iterations_ == iteration_limit_ || at_step_limit_) {
      const LocalResult local =
          residual_ <= kOptimalResidual ? LocalResult::converged : LocalResult::budget_spent;
      if (scene_asked || (all_gaps_open() && add_touching_contacts(state))) return local;
      if (!restore_admissibility(state) && !project_translation_or_rotate(state))
        return LocalResult::infeasible;
      scene_asked = true;
      continue;
    }
    ++iterations_;
    factorise_model(state);
    Vector6d dy;
    const bool stepped = newton_step(g, dy);
    const double predicted_decrease = stepped ? -g.dot(dy) : 0.0;  // first-order decrease of T
    const bool ask_scene =
        scene_asked || has_idle_contact();  // a contact without load may have to be replaced
    const LineSearchResult searched =
        stepped ? line_search(state, dy, predicted_decrease, ask_scene) : LineSearchResult::no_decrease;
    if (searched == LineSearchResult::decreased) scene_asked = ask_scene;
    const bool short_step = searched == LineSearchResult::decreased && dy.norm() < kShortStep;
    before_short_step = short_step ? residual_ : std::numeric_limits<double>::infinity();
    if (searched != LineSearchResult::no_decrease) continue;  // decreased, or found contacts: next model
    if (at_step_limit_) continue;
    if (!scene_asked) {
      if (!project_translation_or_rotate(state)) return LocalResult::infeasible;
      scene_asked = true;
      continue;
    }
    linearise(state);  // contacts may have been dropped
    residual_ = residual(gradient(state));
    return residual_ <= kOptimalResidual ? LocalResult::converged : LocalResult::budget_spent;
  }
}

/// KKT residual |g - sum multiplier_i J_i| / |g|, METHOD (42), at the state linearised last. A multiplier of
/// an open contact does not count.
double ExactProjection::residual(const Vector6d& g) const noexcept {
  Vector6d rest = g;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (multiplier_[i] > 0.0 && gap_[i] <= kTouching) rest -= multiplier_[i] * J_[i];
  return std::sqrt(rest.squaredNorm() / std::max(g.squaredNorm(), kMinGradient * kMinGradient));
}

/// True if all gaps of the state linearised last are open. A state without a scene query may overlap a
/// contact found in a later trial.
bool ExactProjection::all_gaps_open() const noexcept {
  const double least = -2.0 * (gap_slack_ + rounding_m_ / L_);
  return std::all_of(gap_.begin(), gap_.begin() + contacts_.size(), [=](double gap) { return gap >= least; });
}

bool ExactProjection::has_idle_contact() const noexcept {
  return std::any_of(multiplier_.begin(), multiplier_.begin() + contacts_.size(),
                     [](double m) { return !(m > 0.0); });
}

/// Line search along dy, METHOD (41): halves the step until T decreases by kArmijo times the predicted
/// decrease. A failed trial that found new contacts ends the search; the next step includes them.
ExactProjection::LineSearchResult ExactProjection::line_search(Iterate& state, const Vector6d& dy,
                                                               double predicted_decrease,
                                                               bool ask_scene) noexcept {
  constexpr double kArmijo = 1e-4;  // Armijo constant, usual value
  constexpr int kMaxHalvings = 20;  // below a millionth of a step the model is not accurate
  const Vector3d eta = dy.tail<3>();
  // Apparent increase of T by rounding of T and by the tolerance gap_slack_ of the translation.
  const double rounding = dy.norm() < kShortStep ? 1e-14 * state.T + 4.0 * gap_slack_ * state.u.norm() : 0.0;
  double fraction =
      1.0 / std::max(1.0, eta.norm() / std::min(1.0, step_limit_.rotation_rad));  // at most one radian
  for (int halving = 0; halving < kMaxHalvings; ++halving, fraction *= 0.5) {
    Iterate trial = state;
    rotate(trial, fraction * eta);
    const std::size_t known = contacts_.size();
    if ((ask_scene ? restore_admissibility(trial) : translate(trial)) &&
        trial.T <= state.T + rounding - kArmijo * fraction * predicted_decrease) {
      if (exceeds_step_limit(trial)) {
        at_step_limit_ = true;
        continue;
      }
      state = trial;
      return LineSearchResult::decreased;
    }
    if (contacts_.size() > known) return LineSearchResult::found_contacts;
  }
  return LineSearchResult::no_decrease;
}

/// Searches a rotation at which a translation is admissible, by Gauss-Newton on the deepest violation t,
/// METHOD (43):
///
///   min  t^2 + small |dy|^2   s.t.   J_i dy + t >= -gap_i
///
/// A least-distance problem in seven dimensions that always has a solution.
bool ExactProjection::find_feasible_rotation(Iterate& state) noexcept {
  constexpr double kRegularisation = 1e-3;  // weight of dy relative to t; small, so that t decreases
  constexpr int kSteps = 30;
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  for (int step = 0; step < kSteps; ++step) {
    linearise(state);
    feasibility_problem_.clear();
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      Vector7d row;
      row << J_[i] / kRegularisation, 1.0;
      feasibility_problem_.add(row, -gap_[i]);
    }
    using Status = LeastDistance<7, ContactSet::kCapacity>::Status;
    if (feasibility_problem_.solve(Vector7d::Zero(), kGapTolerance) == Status::infeasible) return false;
    Vector6d dy = feasibility_problem_.z().head<6>() / kRegularisation;
    const double largest_turn = dy.tail<3>().norm();
    if (largest_turn > 0.5) dy *= 0.5 / largest_turn;
    if (dy.norm() < kShortStep) return false;
    state.u += dy.head<3>();
    rotate(state, dy.tail<3>());
    if (restore_admissibility(state)) return true;
  }
  return false;
}

/// Drops open contacts without a multiplier in the last step and in the last translation.
void ExactProjection::drop_idle_contacts(const Iterate& state) noexcept {
  for (std::size_t i = contacts_.size(); i-- > 0;) {
    const AffineGap gap = affine_gap(local_contacts_[i], state.R, clearance_);
    if (multiplier_[i] > 0.0 || translation_problem_.multiplier(i) > 0.0 ||
        gap.n.dot(state.u) + gap.h < kTouching)
      continue;
    contacts_.remove_unordered(i);
    const std::size_t last = contacts_.size();
    local_contacts_[i] = local_contacts_[last];
    multiplier_[i] = multiplier_[last];
    translation_problem_.remove_unordered(i);
  }
}

/// Adds contacts that touch without load. Returns false and adds nothing if one of them overlaps.
bool ExactProjection::add_touching_contacts(const Iterate& state) noexcept {
  const std::size_t known = contacts_.size();
  const Pose X_WQ = to_pose(state);
  scene_->add_touching(X_WQ, (kTouching + clearance_) * L_, contacts_);
  update_local_contacts(known);
  touching_added_ = true;
  for (std::size_t i = known; i < contacts_.size() && touching_added_; ++i) {
    const AffineGap at = affine_gap(local_contacts_[i], state.R, clearance_);
    gap_[i] = at.n.dot(state.u) + at.h;
    touching_added_ = gap_[i] * L_ >= -rounding_m_;
  }
  // A full set may lack further contacts.
  if (contacts_.full() && touching_added_) touching_added_ = scene_->admits(X_WQ, tolerance_m_);
  if (!touching_added_) contacts_.truncate(known);
  return touching_added_;
}

/// Fills in energy, touching contacts, multipliers and residual of the result.
void ExactProjection::fill_projection(Projection& out) noexcept {
  out.X_WQ = to_pose(state_);
  out.kkt_residual = residual_;
  if (!touching_added_) add_touching_contacts(state_);
  out.energy = state_.T * M_.mass_kg * L_ * L_;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (gap_[i] <= kTouching) out.active.add({contacts_[i], multiplier_[i] * M_.mass_kg * L_});
}

bool ExactProjection::certify_global() noexcept {
  const std::span<const LocalContact> contacts(local_contacts_.data(), contacts_.size());
  const std::span<const double> multipliers(multiplier_.data(), contacts_.size());
  return has_dual_bound(contacts, multipliers) && meets_dual_bound(lagrangian_hessian(state_));
}

}  // namespace wrenchd
