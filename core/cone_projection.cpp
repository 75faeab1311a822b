// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/cone_projection.hpp"

#include <cmath>
#include <limits>
#include <utility>

namespace wrenchd {
namespace {

/// Squared sine below which a normal counts as dependent on the active normals.
constexpr double kDependent = 1e-18;
/// Slip below which a cone is taken at its apex [m].
constexpr double kNoSlip_m = 1e-15;
/// Steps per dimension and per cone, after which a solve gives up.
constexpr std::size_t kMaxStepsPerUnknown = 8;

}  // namespace

ConeProjection::ConeProjection(std::size_t max_bodies, std::size_t max_cones) {
  const auto size = at(max_bodies);
  cones_.reserve(max_cones);
  active_.reserve(static_cast<std::size_t>(size) + 1);
  suggested_.reserve(static_cast<std::size_t>(size) + 1);
  behind_.reserve(static_cast<std::size_t>(size) + 1);
  for (Eigen::VectorXd* vector : {&z0_, &z_, &rest_, &r_, &d_}) vector->setZero(size);
  Q_.setZero(size, size);
  R_.setZero(size, size);
}

void ConeProjection::clear(std::size_t bodies) noexcept {
  dimension_ = static_cast<std::size_t>(at(bodies));
  cones_.clear();
  suggested_.clear();
}

void ConeProjection::suggest(std::size_t cone, const Vector3d& normal) noexcept {
  if (suggested_.size() == suggested_.capacity()) return;
  HalfSpace one;
  one.cone = cone;
  one.normal = normal;
  suggested_.push_back(one);
}

bool ConeProjection::add(const FrictionCone& cone) noexcept {
  if (cones_.size() == cones_.capacity()) return false;
  cones_.push_back(cone);
  return true;
}

Vector3d ConeProjection::displacement(const FrictionCone& cone) const noexcept {
  Vector3d out = Vector3d::Zero();
  if (cone.a != FrictionCone::kFixed) out += cone.D_a * z_.segment<kBlock>(at(cone.a));
  if (cone.b != FrictionCone::kFixed) out += cone.D_b * z_.segment<kBlock>(at(cone.b));
  return out;
}

/// METHOD (108). direction: unit tangent, or zero for the half-space of the normal alone.
ConeProjection::HalfSpace ConeProjection::tangent(std::size_t i, const Vector3d& direction) const noexcept {
  const FrictionCone& cone = cones_[i];
  HalfSpace out;
  out.cone = i;
  out.normal = cone.n - cone.mu * direction;
  double squared = 0.0;
  if (cone.a != FrictionCone::kFixed) squared += (cone.D_a.transpose() * out.normal).squaredNorm();
  if (cone.b != FrictionCone::kFixed) squared += (cone.D_b.transpose() * out.normal).squaredNorm();
  out.length = std::sqrt(squared);
  out.bound = (cone.mu * direction.dot(cone.slip_m) - cone.h_m) / out.length;
  return out;
}

/// Returns the product of the scaled normal of a half-space and z.
double ConeProjection::product(const HalfSpace& half_space, const Eigen::VectorXd& z) const noexcept {
  const FrictionCone& cone = cones_[half_space.cone];
  Vector3d moved = Vector3d::Zero();
  if (cone.a != FrictionCone::kFixed) moved += cone.D_a * z.segment<kBlock>(at(cone.a));
  if (cone.b != FrictionCone::kFixed) moved += cone.D_b * z.segment<kBlock>(at(cone.b));
  return half_space.normal.dot(moved) / half_space.length;
}

/// Adds a multiple of the scaled normal of a half-space to z.
void ConeProjection::scatter(const HalfSpace& half_space, double factor, Eigen::VectorXd& z) const noexcept {
  const FrictionCone& cone = cones_[half_space.cone];
  const Vector3d scaled = factor / half_space.length * half_space.normal;
  if (cone.a != FrictionCone::kFixed) z.segment<kBlock>(at(cone.a)) += cone.D_a.transpose() * scaled;
  if (cone.b != FrictionCone::kFixed) z.segment<kBlock>(at(cone.b)) += cone.D_b.transpose() * scaled;
}

/// Finds the half-space that z violates most, in units of z. Returns false if no cone is violated by more
/// than the tolerance.
bool ConeProjection::most_violated(double tolerance_m, HalfSpace& worst) const noexcept {
  double most = 0.0;
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    const FrictionCone& cone = cones_[i];
    const Vector3d moved = displacement(cone);
    const Vector3d slip = moved - cone.n.dot(moved) * cone.n + cone.slip_m;
    const double length = slip.norm();
    const double violation_m = cone.mu * length - cone.n.dot(moved) - cone.h_m;
    if (!(violation_m > tolerance_m)) continue;
    const Vector3d direction = length > kNoSlip_m ? Vector3d(slip / length) : Vector3d(Vector3d::Zero());
    const HalfSpace candidate = tangent(i, direction);
    if (!(candidate.length > 0.0) || !(violation_m / candidate.length > most)) continue;
    most = violation_m / candidate.length;
    worst = candidate;
  }
  return most > 0.0;
}

ConeProjection::Status ConeProjection::solve(double tolerance_m) noexcept {
  z_ = z0_;
  active_.clear();
  steps_ = 0;
  start_with_suggested();
  const std::size_t max_steps = kMaxStepsPerUnknown * (dimension_ + cones_.size()) + kMaxStepsPerUnknown;
  Status status = Status::budget_spent;
  HalfSpace worst;
  for (; steps_ < max_steps; ++steps_) {
    if (!most_violated(tolerance_m, worst)) {
      status = Status::optimal;
      break;
    }
    if (!activate(worst)) {
      status = Status::infeasible;
      break;
    }
  }
  return status;
}

/// Makes the suggested half-spaces active, with their directions and the cones of this problem, and drops
/// those with a negative multiplier, the most negative one first.
void ConeProjection::start_with_suggested() noexcept {
  for (const HalfSpace& old : suggested_) {
    if (old.cone >= cones_.size()) continue;
    const FrictionCone& cone = cones_[old.cone];
    Vector3d direction = Vector3d::Zero();
    if (cone.mu > 0.0) {
      direction = old.normal - cone.n.dot(old.normal) * cone.n;
      const double length = direction.norm();
      direction = length > 1e-9 ? Vector3d(-direction / length) : Vector3d(Vector3d::Zero());
    }
    const HalfSpace half_space = tangent(old.cone, direction);
    if (half_space.length > 0.0) append(half_space);
  }
  while (!active_.empty()) {
    recompute();
    std::size_t worst = active_.size();
    double most = 0.0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      if (active_[k].multiplier >= most) continue;
      most = active_[k].multiplier;
      worst = k;
    }
    if (worst == active_.size()) return;
    drop(worst);
  }
}

/// Sets z to the point nearest to z0 on the active half-spaces' planes, and their multipliers: R' R mu = c -
/// B' z0.
void ConeProjection::recompute() noexcept {
  const auto count = static_cast<Eigen::Index>(active_.size());
  z_ = z0_;
  if (count == 0) return;
  for (Eigen::Index k = 0; k < count; ++k) {
    const HalfSpace& one = active_[static_cast<std::size_t>(k)];
    double sum = one.bound - product(one, z0_);
    for (Eigen::Index j = 0; j < k; ++j) sum -= R_(j, k) * r_[j];
    r_[k] = sum / R_(k, k);
  }
  const auto size = static_cast<Eigen::Index>(dimension_);
  for (Eigen::Index k = 0; k < count; ++k) z_.head(size) += r_[k] * Q_.col(k).head(size);
  back_substitute(r_, d_);
  for (Eigen::Index k = 0; k < count; ++k) active_[static_cast<std::size_t>(k)].multiplier = d_[k];
}

/// Makes a half-space active and drops those whose multiplier reaches zero, METHOD (33). Returns false if the
/// half-spaces contradict each other.
bool ConeProjection::activate(HalfSpace entering) noexcept {
  const auto size = static_cast<Eigen::Index>(dimension_);
  for (;;) {
    rest_.head(size).setZero();
    scatter(entering, 1.0, rest_);
    project_out(rest_, r_);
    back_substitute(r_, d_);
    const double curvature = rest_.head(size).squaredNorm();
    const bool independent = curvature > kDependent && active_.size() < dimension_;
    const double violation = entering.bound - product(entering, z_);
    const double full = independent ? violation / curvature : std::numeric_limits<double>::infinity();
    double partial = std::numeric_limits<double>::infinity();
    std::size_t leaving = 0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const double rate = d_[static_cast<Eigen::Index>(k)];
      if (!(rate > 0.0) || !(active_[k].multiplier < partial * rate)) continue;
      partial = active_[k].multiplier / rate;
      leaving = k;
    }
    const double t = std::fmin(full, partial);
    if (!(t < std::numeric_limits<double>::infinity())) return false;
    for (std::size_t k = 0; k < active_.size(); ++k)
      active_[k].multiplier -= t * d_[static_cast<Eigen::Index>(k)];
    entering.multiplier += t;
    if (independent) z_.head(size) += t * rest_.head(size);
    if (full <= partial) {
      append(entering, std::sqrt(curvature));
      return true;
    }
    drop(leaving);
  }
}

/// Subtracts from `rest` its projection on the active normals; r receives the coefficients on Q.
/// Orthogonalises a second time if cancellation loses digits.
void ConeProjection::project_out(Eigen::VectorXd& rest, Eigen::VectorXd& r) const noexcept {
  constexpr double kLittleLost = 0.5;  // fraction of the squared length, which is 1
  const auto size = static_cast<Eigen::Index>(dimension_);
  const auto count = static_cast<Eigen::Index>(active_.size());
  r.head(count).setZero();
  for (int pass = 0; pass < 2; ++pass) {
    for (Eigen::Index k = 0; k < count; ++k) {
      const double c = Q_.col(k).head(size).dot(rest.head(size));
      rest.head(size) -= c * Q_.col(k).head(size);
      r[k] += c;
    }
    if (count == 0 || rest.head(size).squaredNorm() > kLittleLost) break;
  }
}

void ConeProjection::back_substitute(const Eigen::VectorXd& r, Eigen::VectorXd& d) const noexcept {
  const auto count = static_cast<Eigen::Index>(active_.size());
  for (Eigen::Index k = count; k-- > 0;) {
    double sum = r[k];
    for (Eigen::Index j = k + 1; j < count; ++j) sum -= R_(k, j) * d[j];
    d[k] = sum / R_(k, k);
  }
}

/// Appends a half-space whose normal is orthogonalised here. Returns false if it depends on the active ones.
bool ConeProjection::append(const HalfSpace& half_space) noexcept {
  if (active_.size() >= dimension_) return false;
  rest_.head(static_cast<Eigen::Index>(dimension_)).setZero();
  scatter(half_space, 1.0, rest_);
  project_out(rest_, r_);
  const double curvature = rest_.head(static_cast<Eigen::Index>(dimension_)).squaredNorm();
  if (!(curvature > kDependent)) return false;
  append(half_space, std::sqrt(curvature));
  return true;
}

/// Appends a half-space whose normal is rest_ + Q r_.
void ConeProjection::append(const HalfSpace& half_space, double length) noexcept {
  const auto size = static_cast<Eigen::Index>(dimension_);
  const auto k = static_cast<Eigen::Index>(active_.size());
  Q_.col(k).head(size) = rest_.head(size) / length;
  R_.col(k).head(k) = r_.head(k);
  R_(k, k) = length;
  active_.push_back(half_space);
}

/// Removes the k-th active half-space and rebuilds the columns behind it.
void ConeProjection::drop(std::size_t k) noexcept {
  behind_.assign(active_.begin() + static_cast<std::ptrdiff_t>(k) + 1, active_.end());
  active_.resize(k);
  for (const HalfSpace& half_space : behind_) append(half_space);
}

StaticVector<Vector3d, 4> ConeProjection::active_normals(std::size_t cone) const noexcept {
  StaticVector<Vector3d, 4> out;
  for (const HalfSpace& one : active_)
    if (one.cone == cone) out.add(one.normal);
  return out;
}

Vector3d ConeProjection::force(std::size_t cone) const noexcept {
  Vector3d sum = Vector3d::Zero();
  for (const HalfSpace& one : active_)
    if (one.cone == cone) sum += one.multiplier / one.length * one.normal;
  return sum;
}

}  // namespace wrenchd
