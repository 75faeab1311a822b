// SPDX-License-Identifier: GPL-3.0-or-later
// Coulomb's law of a ConeProjection by Newton's method: core/METHOD.md, section 15.8.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/cone_projection.hpp"

namespace wrenchd {
namespace {

/// Slip below which a cone counts as sticking in a Newton step [m].
constexpr double kStick_m = 1e-10;
/// Steps for the lifts of Coulomb's law.
constexpr int kLiftSteps = 3;
/// Least pivot of the equations for the lifts; their diagonal is 1 without coupling.
constexpr double kLeastPivot = 1e-10;
/// A Newton step that turns no direction of friction farther than this is the last one [rad].
constexpr double kTurned_rad = 1e-6;
constexpr double kMostTurned_rad = 1.0;
constexpr int kNewtonSteps = 8;
/// Rounding of a load [N].
constexpr double kNoLoad_N = 1e-12;

Eigen::Index at_row(std::size_t i) noexcept {
  return static_cast<Eigen::Index>(i);
}

}  // namespace

ConeProjection::Status ConeProjection::solve_coulomb(double tolerance_m) noexcept {
  steps_ = 0;
  for (int k = 0; k < kLiftSteps; ++k) {
    start_with_suggested();
    const Status status = enter_violated(tolerance_m);
    take_forces();
    if (status == Status::infeasible) return status;
    const bool fits = lifts_fit(tolerance_m);
    if (fits && !slides()) return status;
    const auto size = static_cast<Eigen::Index>(dimension_);
    z_before_.head(size) = z_.head(size);
    if (solve_active() && obeys_coulomb(tolerance_m)) return Status::optimal;
    z_.head(size) = z_before_.head(size);
    take_forces();
    if (fits) return status;
    suggest_active();
    for (std::size_t i = 0; i < cones_.size(); ++i) cones_[i].s_m = lift_m(i);
  }
  return Status::budget_spent;
}

/// True if the lifts of the cones are those of Coulomb's law at z, to the tolerance.
bool ConeProjection::lifts_fit(double tolerance_m) const noexcept {
  for (std::size_t i = 0; i < cones_.size(); ++i)
    if (!(std::abs(lift_m(i) - cones_[i].s_m) <= tolerance_m)) return false;
  return true;
}

/// True if a cone that carries slides. The tolerance of a cone then leaves the direction of the slip open.
bool ConeProjection::slides() const noexcept {
  return std::any_of(active_.begin(), active_.end(), [this](const HalfSpace& one) {
    return cones_[one.cone].mu > 0.0 && slip(cones_[one.cone]).norm() > kStick_m;
  });
}

/// Solves Coulomb's law for the active cones. A cone with a negative load is left out. Returns false without
/// an answer.
bool ConeProjection::solve_active() noexcept {
  left_out_.assign(cones_.size(), false);
  double last_rad = kMostTurned_rad;
  for (int n = 0; n < kNewtonSteps; ++n) {
    const double turned_rad = newton_step();
    if (!(turned_rad < last_rad)) return false;
    last_rad = turned_rad;
    if (turned_rad > kTurned_rad) continue;
    last_rad = kMostTurned_rad;
    std::size_t worst = cones_.size();
    double most = -kNoLoad_N;
    for (std::size_t i = 0; i < cones_.size(); ++i) {
      const double load = cones_[i].n.dot(forces_[i]);
      if (load < most) {
        most = load;
        worst = i;
      }
    }
    if (worst == cones_.size()) return true;
    left_out_[worst] = true;
  }
  return false;
}

/// True if z and the forces satisfy Coulomb's law, to the tolerance.
bool ConeProjection::obeys_coulomb(double tolerance_m) const noexcept {
  constexpr double kOutside = 1e-9;  // of the cone, as a coefficient of friction
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    const FrictionCone& cone = cones_[i];
    if (!(cone.n.dot(displacement(cone, z_)) + cone.h_m > -tolerance_m)) return false;
    const double load = cone.n.dot(forces_[i]);
    const double most = (cone.mu + kOutside) * std::max(load, 0.0) + kNoLoad_N;
    const Vector3d friction_N = forces_[i] - load * cone.n;
    if (!(load >= -kNoLoad_N) || !(friction_N.squaredNorm() <= most * most)) return false;
    // Newton's method can also converge to friction that drives the slip instead of braking it.
    const Vector3d slip_m = slip(cone);
    if (slip_m.norm() > kStick_m && friction_N.dot(slip_m) > kNoLoad_N * slip_m.norm()) return false;
  }
  return true;
}

/// A Newton step for Coulomb's law among the active cones, METHOD (112): an unknown for the load and one for
/// the direction of friction of each cone that slides, and three for the force of one that sticks. Changes z
/// and the forces. Returns the largest angle by which a direction turned [rad].
double ConeProjection::newton_step() noexcept {
  ++steps_;
  set_unknowns();
  const std::size_t count = unknowns_.size();
  for (std::size_t j = 0; j < count; ++j) {
    const Unknown& one = unknowns_[j];
    for (std::size_t i = 0; i < count; ++i) J_(at_row(i), at_row(j)) = response(unknowns_[i], one);
    J_(at_row(j), at_row(j)) += one.turn;
    x_[at_row(j)] = one.target - one.row.dot(displacement(cones_[one.cone], z_));
  }
  eliminate(at_row(count));
  double turned_rad = 0.0;
  for (std::size_t j = 0; j < count; ++j) {
    const Unknown& one = unknowns_[j];
    const double change = x_[at_row(j)];
    push(cones_[one.cone], change * one.force, z_);
    forces_[one.cone] += change * one.force;
    if (one.turn != 0.0) turned_rad = std::max(std::abs(change), turned_rad);
  }
  return turned_rad;
}

/// Sets the unknowns of a Newton step, for forces that have the directions of the present slips; corrects z
/// for these.
void ConeProjection::set_unknowns() noexcept {
  unknowns_.clear();
  const auto size = static_cast<Eigen::Index>(dimension_);
  rest_.head(size).setZero();  // change of z
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const std::size_t i = active_[k].cone;
    const FrictionCone& cone = cones_[i];
    if (left_out_[i]) {
      push(cone, -forces_[i], rest_);
      forces_[i].setZero();
      continue;
    }
    const bool known = std::any_of(active_.begin(), active_.begin() + static_cast<std::ptrdiff_t>(k),
                                   [i](const HalfSpace& one) { return one.cone == i; });
    if (known) continue;
    const Vector3d slipped = slip(cone);
    const double length = slipped.norm();
    if (cone.mu > 0.0 && length <= kStick_m) {
      const Vector3d t = cone.n.unitOrthogonal();
      add_unknown(i, cone.n, cone.n, 0.0, -cone.h_m);
      for (const Vector3d& axis : {t, Vector3d(cone.n.cross(t))})
        add_unknown(i, axis, axis, 0.0, -axis.dot(cone.slip_m));
      continue;
    }
    const Vector3d d = length > 0.0 ? Vector3d(slipped / length) : Vector3d(Vector3d::Zero());
    const double load_N = cone.n.dot(forces_[i]);
    const Vector3d f = cone.n - cone.mu * d;
    add_unknown(i, f, cone.n, 0.0, -cone.h_m);
    if (cone.mu > 0.0) {
      const Vector3d t = cone.n.cross(d);
      add_unknown(i, -cone.mu * load_N * t, t, -length, -t.dot(cone.slip_m));
    }
    push(cone, load_N * f - forces_[i], rest_);
    forces_[i] = load_N * f;
  }
  z_.head(size) += rest_.head(size);
}

void ConeProjection::add_unknown(std::size_t i, const Vector3d& force, const Vector3d& row, double turn,
                                 double target) noexcept {
  const FrictionCone& cone = cones_[i];
  unknowns_.push_back({i, force, row, cone.D_a.transpose() * force, cone.D_b.transpose() * force,
                       cone.D_a.transpose() * row, cone.D_b.transpose() * row, turn, target});
}

/// Change of the left side of the equation of `one` with the unknown `other`, by the displacements.
double ConeProjection::response(const Unknown& one, const Unknown& other) const noexcept {
  const FrictionCone &a = cones_[one.cone], &b = cones_[other.cone];
  double sum = 0.0;
  if (a.a == b.a && a.a != FrictionCone::kFixed) sum += one.row_a.dot(other.push_a);
  if (a.a == b.b && a.a != FrictionCone::kFixed) sum += one.row_a.dot(other.push_b);
  if (a.b == b.a && a.b != FrictionCone::kFixed) sum += one.row_b.dot(other.push_a);
  if (a.b == b.b && a.b != FrictionCone::kFixed) sum += one.row_b.dot(other.push_b);
  return sum;
}

/// Suggests the active half-spaces for the next solve: of a cone that slides, the one of its present
/// direction.
void ConeProjection::suggest_active() noexcept {
  suggested_.clear();
  for (const HalfSpace& one : active_) {
    const FrictionCone& cone = cones_[one.cone];
    const Vector3d slipped = slip(cone);
    const double length = slipped.norm();
    if (cone.mu == 0.0 || length <= kStick_m) {
      suggested_.push_back(one);
      continue;
    }
    const bool known = std::any_of(suggested_.begin(), suggested_.end(),
                                   [&](const HalfSpace& other) { return other.cone == one.cone; });
    if (!known) suggest(one.cone, cone.n - cone.mu / length * slipped);
  }
}

/// Solves J x' = x by elimination; x' replaces x. An unknown that depends on those before it is zero, and
/// equations that are left over hold or contradict the others. Eigen's decomposition would allocate.
void ConeProjection::eliminate(Eigen::Index size) noexcept {
  if (size == 0) return;
  const double largest = J_.topLeftCorner(size, size).cwiseAbs().maxCoeff();
  Eigen::Index rank = 0;
  for (Eigen::Index k = 0; k < size; ++k) {
    Eigen::Index pivot = rank;
    for (Eigen::Index i = rank + 1; i < size; ++i)
      if (std::abs(J_(i, k)) > std::abs(J_(pivot, k))) pivot = i;
    pivots_[static_cast<std::size_t>(k)] =
        rank < size && std::abs(J_(pivot, k)) > kLeastPivot * largest ? rank : -1;
    if (pivots_[static_cast<std::size_t>(k)] < 0) continue;
    for (Eigen::Index j = k; j < size && pivot != rank; ++j) std::swap(J_(rank, j), J_(pivot, j));
    std::swap(x_[rank], x_[pivot]);
    const Eigen::Index below = size - rank - 1;
    auto factors = J_.col(k).segment(rank + 1, below);
    factors /= J_(rank, k);
    for (Eigen::Index j = k + 1; j < size; ++j)
      if (J_(rank, j) != 0.0) J_.col(j).segment(rank + 1, below) -= J_(rank, j) * factors;
    x_.segment(rank + 1, below) -= x_[rank] * factors;
    ++rank;
  }
  for (Eigen::Index k = size; k-- > 0;) {
    const Eigen::Index row = pivots_[static_cast<std::size_t>(k)];
    d_x_[k] = row < 0 ? 0.0 : x_[row] / J_(row, k);
    if (row > 0) x_.head(row) -= d_x_[k] * J_.col(k).head(row);
  }
  x_.head(size) = d_x_.head(size);
}

}  // namespace wrenchd
