// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/projection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace wrenchd {
namespace {

/// A gap this far below zero, in units of L, counts as closed: rounding of one rotation and one dot product.
constexpr double kGapTolerance = 2e-15;
/// Wedged between opposite contacts only one translation is left, and rounding must not make it none: where
/// it does, contacts that are held open give way by this share of it.
constexpr double kSlack = 1e-3;
/// A contact this near, in units of L, touches at q.
constexpr double kTouching = 1e-9;
/// Converged: the step left is this short, in units of L and rad, and the KKT residual this small before it
/// is taken.
constexpr double kShortStep = 1e-7;
constexpr double kSmallResidual = 2e-10;
/// Where a short step no longer halves the residual, what is left is rounding, if it is no more than this.
constexpr double kRoundedResidual = 1e-8;
/// Curvature of the Lagrangian, relative to the metric's, that a step may count on where there is less.
constexpr double kLeastCurvature = 1e-3;
/// The gradient of a penetration of half a millionth of L: below it, the residual is measured against this.
constexpr double kLeastGradient = 1e-6;
/// With more contacts than this, idle ones are dropped.
constexpr std::size_t kCrowded = 24;
/// How many times the budget of a tick a query without history may take for each of its starts.
constexpr int kPatience = 5;

/// Lower triangular root of a symmetric matrix, inverted:  A = L D L',  (L sqrt D)^-1 = D^-1/2 L^-1.  False
/// where the matrix is not safely positive definite: a pivot that is all rounding would make the step all
/// rounding.
bool inverse_root(const Matrix3d& A, Matrix3d& inverse) noexcept {
  constexpr double kLeastPivot = 1e-13;
  const auto safe = [](double pivot, double diagonal) { return pivot > kLeastPivot * std::abs(diagonal); };
  const double d0 = A(0, 0);
  if (!(d0 > 0.0)) return false;
  const double l10 = A(1, 0) / d0;
  const double l20 = A(2, 0) / d0;
  const double d1 = A(1, 1) - l10 * A(1, 0);
  if (!safe(d1, A(1, 1))) return false;
  const double a21 = A(2, 1) - l20 * A(1, 0);
  const double l21 = a21 / d1;
  const double d2 = A(2, 2) - l20 * A(2, 0) - l21 * a21;
  if (!safe(d2, A(2, 2))) return false;
  const double i0 = 1.0 / std::sqrt(d0);
  const double i1 = 1.0 / std::sqrt(d1);
  const double i2 = 1.0 / std::sqrt(d2);
  inverse << i0, 0.0, 0.0, -l10 * i1, i1, 0.0, (l10 * l21 - l20) * i2, -l21 * i2, i2;
  return true;
}

double positive_length(const Inertia& M) {
  const double squared = M.H_kg_m2.trace() / (2.0 * M.mass_kg);
  return squared > 0.0 ? std::sqrt(squared) : 1.0;
}

}  // namespace

StaticVector<ActiveContact, ContactSet::kCapacity> evenly_loaded_contacts(
    const Projection& projection) noexcept {
  StaticVector<ActiveContact, ContactSet::kCapacity> shared;
  for (const ActiveContact& a : projection.active) {
    double touching = 0.0;
    double carried = 0.0;
    for (const ActiveContact& b : projection.active) {
      if (b.contact.obstacle != a.contact.obstacle) continue;
      touching += 1.0;
      carried += b.multiplier;
    }
    shared.add({a.contact, carried / touching});
  }
  return shared;
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
                                 const StepLimit& leash) noexcept {
  /// The contacts are all known: nothing is asked.
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
  step_start_.E = relative_rotation(X_start.rotation);
  step_start_.R = step_start_.E.toRotationMatrix();
  step_start_.u = X_WP.rotation.conjugate() * (X_start.translation_m - X_WP.translation_m) / L_;
  step_start_.T = scaled_energy(step_start_);
  step_limit_ = leash;
  state_ = Iterate{};
  if (free_at_p && !exceeds_step_limit(state_)) {
    step_limit_ = StepLimit{};
    return free_projection();
  }
  state_ = step_start_;
  if (contacts_.empty()) {  // straight to p
    const double turn_rad = step_start_.E.angularDistance(Quaterniond::Identity());
    const double share =
        std::min(leash.translation_m / std::max(step_start_.u.norm() * L_, leash.translation_m),
                 leash.rotation_rad / std::max(turn_rad, leash.rotation_rad));
    state_.E = step_start_.E.slerp(share, Quaterniond::Identity());
    state_.R = state_.E.toRotationMatrix();
    state_.u = (1.0 - share) * step_start_.u;
    state_.T = scaled_energy(state_);
    residual_ = 1.0;
    step_limit_ = StepLimit{};
    return make_projection(LocalResult::budget_spent);
  }
  // What is pushed from two sides may have to turn. Nothing else has to: where it starts is allowed.
  const bool pushed = leash.rotation_rad == std::numeric_limits<double>::infinity();
  if (!translate(state_) && !(pushed && find_feasible_rotation(state_))) {
    step_limit_ = StepLimit{};
    return make_projection(LocalResult::infeasible);
  }
  LocalResult local = LocalResult::budget_spent;
  if (exceeds_step_limit(state_)) {
    // At one rotation the gaps are affine and T is convex: the way to the nearest translation is open, and
    // falls.
    const Vector3d way = state_.u - step_start_.u;
    state_.u = step_start_.u + way * (leash.translation_m / (L_ * way.norm()));
    state_.T = scaled_energy(state_);
    linearise(state_);
    residual_ = residual(gradient(state_));
  } else {
    local = minimise(state_, false);
  }
  step_limit_ = StepLimit{};
  return make_projection(local);
}

/// Is a state beyond the leash?
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
  iteration_limit_ = static_cast<std::uint16_t>(kPatience * budget_.iterations);
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
  const Quaterniond dual_optimum =
      best.status == ProjectionStatus::infeasible ? Quaterniond::Identity() : dual_rotation();

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

  // Where the dual bound is attained; then rotations about the axes of a cube's faces, edges and corners,
  // both ways, near and far from p; then the same around the best of these.
  try_from(dual_optimum);
  for (const double angle : {0.25, 0.6, 1.2, 2.2}) try_around(Quaterniond::Identity(), angle);
  const Quaterniond best_E = relative_rotation(best.X_WQ.rotation);
  for (const double angle : {0.4, 0.9}) try_around(best_E, angle);
  return best;
}

// Rounding of the world coordinates counts too: a body far from the origin has coarser gaps.
double ExactProjection::gap_tolerance_m(const Pose& X_WT) const noexcept {
  return 4.0 * kGapTolerance * (L_ + X_WT.translation_m.lpNorm<Eigen::Infinity>());
}

/// What all attempts at one p share.
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

/// Without history: the contacts to begin with are those that p violates.
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

/// Begins with these contacts and their multipliers. True where p violates none of them.
bool ExactProjection::load_known_contacts(std::span<const ActiveContact> known) noexcept {
  contacts_.clear();
  for (const ActiveContact& active : known) contacts_.add(active.contact);
  update_local_contacts(0);
  bool apart = true;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    multiplier_[i] = known[i].multiplier / (M_.mass_kg * L_);
    apart = apart && !overlaps_at_p(local_contacts_[i]);
  }
  return apart;
}

/// From an admissible pose and the contacts that hold it. Most often one of them tells without asking the
/// scene that p is not admissible.
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

/// What became of the attempt.
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

/// Contacts number `first` and up as p sees them: directions in p's axes, lengths in units of L.
void ExactProjection::update_local_contacts(std::size_t first) noexcept {
  if (first == contacts_.size()) return;
  const Matrix3d R_PW = X_WP_.rotation.toRotationMatrix().transpose();
  for (std::size_t i = first; i < contacts_.size(); ++i) {
    const Contact& contact = contacts_[i];
    LocalContact& seen = local_contacts_[i];
    seen.kind = contact.kind;
    seen.n = R_PW * contact.n_W;
    seen.a = contact.p_TCa_m / L_;
    seen.b.setZero();
    seen.c = (contact.n_W.dot(X_WP_.translation_m) - contact.offset_m) / L_;
    multiplier_[i] = 0.0;
    if (contact.kind == ContactKind::vertex_face) continue;
    seen.b = R_PW * (contact.p_WCb_m - X_WP_.translation_m) / L_;
    seen.d = contact.d_T;
    seen.dB = R_PW * contact.d_W;
  }
}

ExactProjection::AffineGap ExactProjection::affine_gap(const LocalContact& seen,
                                                       const Matrix3d& R) const noexcept {
  switch (seen.kind) {
    case ContactKind::vertex_face:
      break;
    case ContactKind::face_vertex: {
      const Vector3d n = R * seen.d;
      return {n, seen.d.dot(seen.a) - n.dot(seen.b) - clearance_};
    }
    case ContactKind::edge_edge: {
      const Vector3d N = (R * seen.d).cross(seen.dB);
      const Vector3d n = N * (1.0 / N.norm());
      return {n, n.dot(R * seen.a - seen.b) - clearance_};
    }
  }
  return {seen.n, seen.n.dot(R * seen.a) + seen.c - clearance_};
}

/// Is a contact certainly nearer at p than it may be? Without clearance the gap of two edges is looked at
/// without the length of their normal, whose sign is the same.
bool ExactProjection::overlaps_at_p(const LocalContact& seen) const noexcept {
  const double least = -tolerance_m_ / L_;
  switch (seen.kind) {
    case ContactKind::vertex_face:
      break;
    case ContactKind::face_vertex:
      return seen.d.dot(seen.a - seen.b) < least;
    case ContactKind::edge_edge: {
      const Vector3d N = seen.d.cross(seen.dB);
      return N.dot(seen.a - seen.b) < (least > 0.0 ? least * N.norm() : least);
    }
  }
  return seen.n.dot(seen.a) + seen.c < least;
}

double ExactProjection::scaled_energy(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  return state.u.squaredNorm() + 4.0 * v.dot(H_hat_ * v);
}

/// E <- E o (1, eta/2), normalised: a retraction that agrees with exp to second order.
void ExactProjection::rotate(Iterate& state, const Vector3d& eta) const noexcept {
  const Quaterniond step(1.0, 0.5 * eta.x(), 0.5 * eta.y(), 0.5 * eta.z());
  state.E = (state.E * step).normalized();
  state.R = state.E.toRotationMatrix();
}

/// The nearest translation for the state's rotation, exactly:  min |u|^2  s.t.  n_i . u >= -h_i, over the
/// contacts at hand. False where no translation helps.
bool ExactProjection::translate(Iterate& state) noexcept {
  translation_problem_.clear();
  return extend_translation(state);
}

/// The same with contacts that have come since.
bool ExactProjection::extend_translation(Iterate& state) noexcept {
  using Status = LeastDistance<3, ContactSet::kCapacity>::Status;
  for (std::size_t i = translation_problem_.count(); i < contacts_.size(); ++i) {
    const AffineGap gap = affine_gap(local_contacts_[i], state.R);
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

/// The same over all contacts of the scene by constraint generation: solve on the contacts at hand, ask the
/// scene what the answer violates, add it, repeat. Idle contacts make room for new ones: |u| only grows from
/// round to round, so none comes back for ever. False where no translation helps, or none was found in the
/// rounds allowed.
bool ExactProjection::restore_admissibility(Iterate& state) noexcept {
  translation_problem_.clear();
  for (std::uint16_t round = 0; round < budget_.constraint_rounds; ++round) {
    if (!extend_translation(state)) return false;
    if (contacts_.size() > kCrowded) drop_idle_contacts(state);
    const std::size_t known = contacts_.size();
    if (scene_->add_violated(to_pose(state), tolerance_m_, contacts_) == 0)
      return !contacts_.full();  // a full set cannot tell of what it has no room for
    update_local_contacts(known);
  }
  return false;
}

// For E <- E o (1, eta/2) and n_Q = R'n, r = R'(u - b) + a, all in the axes of q, the gradient of a gap is
//
//   J_i = [ n_i ; a x n_Q + (how the normal turns) ]
//
//   vertex_face   nothing
//   face_vertex   d x r                                      n_Q = d
//   edge_edge     d x (dB_Q x r_t) / s                       r_t: r without its part along n,  s = |d x dB_Q|
void ExactProjection::linearise(const Iterate& state) noexcept {
  // Most often this very rotation has just been translated.
  const bool known =
      translation_problem_.count() == contacts_.size() && E_translated_.coeffs() == state.E.coeffs();
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const LocalContact& seen = local_contacts_[i];
    const AffineGap at = known ? AffineGap{translation_problem_.normal(i), -translation_problem_.bound(i)}
                               : affine_gap(seen, state.R);
    const Vector3d n_Q = state.R.transpose() * at.n;
    gap_[i] = at.n.dot(state.u) + at.h;
    Vector3d turning = seen.a.cross(n_Q);
    if (seen.kind != ContactKind::vertex_face) {
      const Vector3d r = state.R.transpose() * (state.u - seen.b) + seen.a;
      if (seen.kind == ContactKind::face_vertex) {
        turning += seen.d.cross(r);
      } else {
        const Vector3d dB = state.R.transpose() * seen.dB;
        turning += seen.d.cross(dB.cross(r - (gap_[i] + clearance_) * n_Q)) / seen.d.cross(dB).norm();
      }
    }
    J_[i].head<3>() = at.n;
    J_[i].tail<3>() = turning;
  }
}

/// With G = (w I + v^)/2, so that dv = G eta:    g = [ 2 u ; 8 G' H^ v ]
Vector6d ExactProjection::gradient(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Vector3d Hv = H_hat_ * v;
  Vector6d g;
  g.head<3>() = 2.0 * state.u;
  g.tail<3>() = 4.0 * (state.E.w() * Hv - v.cross(Hv));
  return g;
}

/// Hessian of T:  [ 2 I, 0; 0, 8 G' H^ G - 2 (v' H^ v) I ]
ExactProjection::HessianBlocks ExactProjection::metric_hessian(const Iterate& state) const noexcept {
  const Vector3d v = state.E.vec();
  const Matrix3d G = 0.5 * (state.E.w() * Matrix3d::Identity() + hat(v));
  HessianBlocks W;
  W.B = 8.0 * G.transpose() * H_hat_ * G;
  W.B.diagonal().array() -= 2.0 * v.dot(H_hat_ * v);
  return W;
}

/// Hessian of the Lagrangian T - sum multiplier_i gap_i: that of T, less sum multiplier_i K_i. K is linear in
/// what contacts of the same normal differ in, so each normal bends once.
ExactProjection::HessianBlocks ExactProjection::lagrangian_hessian(const Iterate& state) const noexcept {
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
    add_contact_curvature(state, i, load, W);
  }
  return W;
}

// K_i, the curvature of gap i, for R = I + eta^ + eta^^2/2, in the axes of q. With
// sym(x, y) = (x y' + y x')/2 and M(x, y) = sym(x, y) - (x . y) I, which is the Hessian of x . R y:
//
//   vertex_face   eta eta: M(n, a)
//   face_vertex   eta eta: M(d, w), w = R'(u - b)            eta u: d^ R' = -(n^ R)'
//   edge_edge     gap = f/s with f = (d x dB) . r, s = |d x dB|:
//     f:  eta eta: M(dB x r, d) - 2 sym(dB, d x a) + M(d x dB, a)
//         eta u: d^ dB^ R' = (R d dB' - (d . dB) R)'
//     s:  gradient g_s = -(d . dB) n
//     gap: (K_f - J g_s' - g_s J')/s, but for a term with the gap itself, which is zero where it matters
//
// load: a, b and J of all contacts with this normal, and 1, each times its multiplier.
void ExactProjection::add_contact_curvature(const Iterate& state, std::size_t i,
                                            const WeightedContactSum& load, HessianBlocks& W) const noexcept {
  const LocalContact& seen = local_contacts_[i];
  const Vector3d n = J_[i].head<3>();
  const auto R_T = state.R.transpose();
  const Vector3d n_Q = R_T * n;
  // B -= M(x, y), with sym(x, y) as x y' until all are in
  const auto bend_by = [&](const Matrix3d& xy, double trace) {
    W.B -= 0.5 * (xy + xy.transpose());
    W.B.diagonal().array() += trace;
  };
  if (seen.kind == ContactKind::vertex_face) {
    bend_by(n_Q * load.a.transpose(), n_Q.dot(load.a));
    return;
  }
  const Vector3d w = R_T * (load.m * state.u - load.b);
  if (seen.kind == ContactKind::face_vertex) {
    bend_by(seen.d * w.transpose(), seen.d.dot(w));
    for (int j = 0; j < 3; ++j) W.C.col(j) += load.m * n.cross(state.R.col(j));
    return;
  }
  const Vector3d dB = R_T * seen.dB;
  const double cosine = seen.d.dot(dB);
  const double s = seen.d.cross(dB).norm();
  const Vector3d lever = dB.cross(w + load.a) / s;
  const Vector3d across = seen.d.cross(load.a) * (2.0 / s);
  const Vector3d tilting = load.a + (2.0 / s * cosine) * load.angular_gradient;
  bend_by(lever * seen.d.transpose() - dB * across.transpose() + n_Q * tilting.transpose(),
          lever.dot(seen.d) + n_Q.dot(load.a));
  W.C -= (load.m / s) * (state.R * seen.d * dB.transpose() + cosine * (n * n_Q.transpose() - state.R));
}

/// [2 I, C; C', B] = root root' with P = sqrt(2) I, Q = C'/sqrt(2), S S' = B - C'C/2. False where it is not
/// positive definite.
bool ExactProjection::factorise(const HessianBlocks& W, CholeskyFactor& root) const noexcept {
  constexpr double kSqrtHalf = 0.70710678118654752440;
  if (!inverse_root(W.B - 0.5 * W.C.transpose() * W.C, root.S_inverse)) return false;
  root.P_inverse = kSqrtHalf * Matrix3d::Identity();
  root.Q = kSqrtHalf * W.C.transpose();
  return true;
}

/// Where the Hessian is not positive definite it is made so, so that the step is a descent: the active
/// gradients are added first, which changes it only across the constraints, where the step is not free, and
/// keeps the convergence quadratic. If that is not enough (far from a minimum), negative eigenvalues are
/// turned over, taken relative to the metric diag(2 I, 2 H^): a needle's roll is a soft direction, not a flat
/// one.
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
  const Vector6d turned_over = eigen.eigenvalues().cwiseAbs().cwiseMax(kLeastCurvature);
  const Matrix6d factor = metric_root_ * eigen.eigenvectors();
  if (split(factor * turned_over.asDiagonal() * factor.transpose())) return;
  split(metric_root_ * metric_root_.transpose());
}

Vector6d ExactProjection::CholeskyFactor::solve(const Vector6d& y) const noexcept {
  Vector6d z;
  const Vector3d upper = P_inverse * y.head<3>();
  z.head<3>() = upper;
  z.tail<3>() = S_inverse * (y.tail<3>() - Q * upper);
  return z;
}

Vector6d ExactProjection::CholeskyFactor::solve_transposed(const Vector6d& z) const noexcept {
  Vector6d y;
  const Vector3d lower = S_inverse.transpose() * z.tail<3>();
  y.head<3>() = P_inverse.transpose() * (z.head<3>() - Q.transpose() * lower);
  y.tail<3>() = lower;
  return y;
}

/// Takes the curvature of the Lagrangian.
///
/// The first multipliers are those of a pure translation, too large where a rotation will do: a Lagrangian
/// that they bend too far gives way to the metric alone.
void ExactProjection::factorise_model(const Iterate& state) noexcept {
  constexpr int kEarly = 2;
  const HessianBlocks W = lagrangian_hessian(state);
  if (factorise(W, factor_)) return;
  if (iterations_ > kEarly || !factorise(metric_hessian(state), factor_)) factorise_convexified(W, factor_);
}

/// The step that minimises the quadratic model within the linearised gaps:
///
///   min 1/2 dy' W dy + g' dy   s.t.   J_i dy >= -gap_i
///
/// With W = root root' and z = root' dy this is a least-distance problem from z0 = -root^-1 g. At an
/// admissible state dy = 0 is allowed, so there always is an answer. Leaves the multipliers.
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

/// The nearest translation out, with its multipliers.
bool ExactProjection::project_translation(Iterate& state) noexcept {
  if (!restore_admissibility(state)) return false;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    multiplier_[i] = 2.0 * translation_problem_.multiplier(i);
  linearise(state);
  residual_ = residual(gradient(state));
  return true;
}

/// The same, from another rotation where no translation helps at this one.
bool ExactProjection::project_translation_or_rotate(Iterate& state) noexcept {
  return project_translation(state) || (find_feasible_rotation(state) && project_translation(state));
}

/// Newton's method, with first guesses of the multipliers. Leaves the gaps of the last state. asked: the
/// scene has been asked about this state, and is about every next. A proxy begins without: the contacts that
/// held it are taken for all there are until they have an answer, or one of them lets go.
ExactProjection::LocalResult ExactProjection::minimise(Iterate& state, bool asked) noexcept {
  double before_short_step = std::numeric_limits<double>::infinity();  // the residual
  for (;;) {
    linearise(state);
    const Vector6d g = gradient(state);
    residual_ = residual(g);
    const bool rounding = residual_ > 0.5 * before_short_step && residual_ <= kRoundedResidual;
    const bool converged = residual_ <= kSmallResidual || rounding;
    if (converged || iterations_ == iteration_limit_ || at_step_limit_) {
      const LocalResult local = converged ? LocalResult::converged : LocalResult::budget_spent;
      if (asked || (all_gaps_open() && add_touching_contacts(state))) return local;
      if (!restore_admissibility(state) && !project_translation_or_rotate(state))
        return LocalResult::infeasible;
      asked = true;
      continue;
    }
    ++iterations_;
    factorise_model(state);
    Vector6d dy;
    const bool stepped = newton_step(g, dy);
    const double promised = stepped ? -g.dot(dy) : 0.0;  // first-order fall of T
    const bool ask = asked || has_idle_contact();        // another has to take its place
    const LineSearchResult moved =
        stepped ? line_search(state, dy, promised, ask) : LineSearchResult::no_decrease;
    if (moved == LineSearchResult::decreased) asked = ask;
    const bool short_step = moved == LineSearchResult::decreased && dy.norm() < kShortStep;
    before_short_step = short_step ? residual_ : std::numeric_limits<double>::infinity();
    if (moved != LineSearchResult::no_decrease)
      continue;  // contacts met: the same state, with a model that knows them
    if (at_step_limit_) continue;
    if (!asked) {
      if (!project_translation_or_rotate(state)) return LocalResult::infeasible;
      asked = true;
      continue;
    }
    linearise(state);  // contacts may have made room for others
    residual_ = residual(gradient(state));
    // Rounding hides the fall of T where the promise is smaller than T's own last digits.
    return stepped && promised <= 1e-13 * state.T ? LocalResult::converged : LocalResult::budget_spent;
  }
}

/// |g - sum multiplier_i J_i| / |g|, at the state that was linearised last. A contact that is apart carries
/// nothing: what it seems to carry counts as missing.
double ExactProjection::residual(const Vector6d& g) const noexcept {
  Vector6d rest = g;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (multiplier_[i] > 0.0 && gap_[i] <= kTouching) rest -= multiplier_[i] * J_[i];
  return std::sqrt(rest.squaredNorm() / std::max(g.squaredNorm(), kLeastGradient * kLeastGradient));
}

/// At the state linearised last. One that was not asked about may overlap what a trial from it has met.
bool ExactProjection::all_gaps_open() const noexcept {
  const double least = -2.0 * (gap_slack_ + rounding_m_ / L_);
  return std::all_of(gap_.begin(), gap_.begin() + contacts_.size(), [=](double gap) { return gap >= least; });
}

bool ExactProjection::has_idle_contact() const noexcept {
  return std::any_of(multiplier_.begin(), multiplier_.begin() + contacts_.size(),
                     [](double m) { return !(m > 0.0); });
}

/// Moves along dy, halving it until T falls by a fair share of what the slope promises. A trial that fails
/// and has met contacts the model did not know ends the search: with them the next step will be a better one.
ExactProjection::LineSearchResult ExactProjection::line_search(Iterate& state, const Vector6d& dy,
                                                               double promised, bool ask) noexcept {
  constexpr double kFairShare = 1e-4;  // Armijo's constant, the usual value
  constexpr int kHalvings = 20;        // below a millionth of a step the model is not to be trusted
  const Vector3d eta = dy.tail<3>();
  // What T may seem to rise by: its own rounding, and that of the translation, which meets its gaps to
  // gap_slack_ only.
  const double rounding = dy.norm() < kShortStep ? 1e-14 * state.T + 4.0 * gap_slack_ * state.u.norm() : 0.0;
  double fraction =
      1.0 / std::max(1.0, eta.norm() / std::min(1.0, step_limit_.rotation_rad));  // one radian at most
  for (int halving = 0; halving < kHalvings; ++halving, fraction *= 0.5) {
    Iterate trial = state;
    rotate(trial, fraction * eta);
    const std::size_t known = contacts_.size();
    if ((ask ? restore_admissibility(trial) : translate(trial)) &&
        trial.T <= state.T + rounding - kFairShare * fraction * promised) {
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

/// Looks for a rotation from which a translation leads out, by Gauss-Newton on the deepest violation t:
///
///   min  t^2 + small |dy|^2   s.t.   J_i dy + t >= -gap_i
///
/// a least-distance problem in seven dimensions that always has an answer.
bool ExactProjection::find_feasible_rotation(Iterate& state) noexcept {
  constexpr double kRegularisation = 1e-3;  // weight of dy against t: small, so that t is what falls
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

/// Drops contacts that are apart and carry nothing, neither of the last step nor of the translation just
/// solved.
void ExactProjection::drop_idle_contacts(const Iterate& state) noexcept {
  for (std::size_t i = contacts_.size(); i-- > 0;) {
    const AffineGap gap = affine_gap(local_contacts_[i], state.R);
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

/// Adds what touches idly. False, and nothing is added, where it is not idle: where something that was not
/// known overlaps.
bool ExactProjection::add_touching_contacts(const Iterate& state) noexcept {
  const std::size_t known = contacts_.size();
  const Pose X_WQ = to_pose(state);
  scene_->add_touching(X_WQ, (kTouching + clearance_) * L_, contacts_);
  update_local_contacts(known);
  touching_added_ = true;
  for (std::size_t i = known; i < contacts_.size() && touching_added_; ++i) {
    const AffineGap at = affine_gap(local_contacts_[i], state.R);
    gap_[i] = at.n.dot(state.u) + at.h;
    touching_added_ = gap_[i] * L_ >= -rounding_m_;
  }
  // A full set cannot tell of what it has no room for.
  if (contacts_.full() && touching_added_) touching_added_ = scene_->admits(X_WQ, tolerance_m_);
  if (!touching_added_) contacts_.truncate(known);
  return touching_added_;
}

/// Fills in what is known of the answer: energy, contacts that touch with their multipliers, and the
/// residual.
void ExactProjection::fill_projection(Projection& out) noexcept {
  out.X_WQ = to_pose(state_);
  out.kkt_residual = residual_;
  if (!touching_added_) add_touching_contacts(state_);
  out.energy = state_.T * M_.mass_kg * L_ * L_;
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (gap_[i] <= kTouching) out.active.add({contacts_[i], multiplier_[i] * M_.mass_kg * L_});
}

// Weak duality gives a proof of global optimality. For any multipliers m_i >= 0, the least value of the
// Lagrangian over all u and all unit quaternions q bounds T from below. A vertex-face gap is quadratic in q,
// n . R(q) a = q' A q with
//
//   A = [ n.a      (a x n)'              ]
//       [ a x n    n a' + a n' - (n.a) I ]
//
// so the Lagrangian is |u|^2 - sum m_i n_i . u - sum m_i c_i + q' Z q with Z = 4 diag(0, H^) - sum m_i A_i.
// At a KKT point u is its minimiser and q an eigenvector of Z. The bound meets T, and no admissible pose is
// closer, where the eigenvalue is the least one: where q' Z q curves upwards on the sphere at q, in all three
// directions. That is the eta block of the Lagrangian's Hessian, so the proof costs one Cholesky factor.
bool ExactProjection::certify_global() noexcept {
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (multiplier_[i] > 0.0 && contacts_[i].kind != ContactKind::vertex_face) return false;
  CholeskyFactor root;
  return factorise(lagrangian_hessian(state_), root);
}

/// The rotation at which the dual bound is attained, the eigenvector of the least eigenvalue of Z: where it
/// is not the optimum it is at least where the Lagrangian would rather be.
Quaterniond ExactProjection::dual_rotation() const noexcept {
  Eigen::Matrix4d Z = Eigen::Matrix4d::Zero();
  Z.bottomRightCorner<3, 3>() = 4.0 * H_hat_;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const double m = multiplier_[i];
    if (!(m > 0.0)) continue;
    const Vector3d& n = local_contacts_[i].n;
    const Vector3d& a = local_contacts_[i].a;
    const Vector3d an = a.cross(n);
    const Matrix3d na = n * a.transpose();
    Z(0, 0) -= m * n.dot(a);
    Z.topRightCorner<1, 3>() -= m * an.transpose();
    Z.bottomLeftCorner<3, 1>() -= m * an;
    Z.bottomRightCorner<3, 3>() -= m * (na + na.transpose() - n.dot(a) * Matrix3d::Identity());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(Z);
  const Eigen::Vector4d q = eigen.eigenvectors().col(0);
  return {q[0], q[1], q[2], q[3]};
}

}  // namespace wrenchd
