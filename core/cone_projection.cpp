// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/cone_projection.hpp"

#include <algorithm>
#include <array>
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

/// Sums of six lanes, which do not wait for each other. size is a multiple of 6.
double dot(const double* a, const double* b, Eigen::Index size) noexcept {
  std::array<double, 6> lanes{};
  for (Eigen::Index i = 0; i < size; i += 6)
    for (std::size_t l = 0; l < 6; ++l)
      lanes[l] += a[i + static_cast<Eigen::Index>(l)] * b[i + static_cast<Eigen::Index>(l)];
  return ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) + (lanes[4] + lanes[5]);
}

void rotate(double c, double s, double& a, double& b) noexcept {
  const double old = a;
  a = c * old + s * b;
  b = c * b - s * old;
}

}  // namespace

ConeProjection::ConeProjection(std::size_t max_bodies, std::size_t max_cones) {
  const auto size = at(max_bodies);
  cones_.reserve(max_cones);
  active_.reserve(static_cast<std::size_t>(size) + 1);
  suggested_.reserve(static_cast<std::size_t>(size) + 1);
  unknowns_.reserve(3 * static_cast<std::size_t>(size));
  for (Eigen::VectorXd* vector : {&z0_, &z_, &z_before_, &rest_, &r_, &d_}) vector->setZero(size);
  ranges_.resize(static_cast<std::size_t>(size));
  Q_.setZero(size, size);
  R_.setZero(size, size);
  J_.setZero(3 * size, 3 * size);
  x_.setZero(3 * size);
  d_x_.setZero(3 * size);
  pivots_.resize(3 * static_cast<std::size_t>(size));
  forces_.reserve(max_cones);
  left_out_.reserve(max_cones);
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

ConeProjection::Range ConeProjection::range_of(const FrictionCone& cone) noexcept {
  Range range;
  for (const std::size_t body : {cone.a, cone.b})
    if (body != FrictionCone::kFixed) range = united(range, {at(body), kBlock});
  return range;
}

/// The shortest range with both. One of size 0 has nothing.
ConeProjection::Range ConeProjection::united(Range a, Range b) noexcept {
  if (a.size == 0) return b;
  if (b.size == 0) return a;
  const Eigen::Index first = std::min(a.first, b.first);
  return {first, std::max(a.first + a.size, b.first + b.size) - first};
}

Vector3d ConeProjection::displacement(const FrictionCone& cone, const Eigen::VectorXd& z) const noexcept {
  Vector3d out = Vector3d::Zero();
  if (cone.a != FrictionCone::kFixed) out += cone.D_a * z.segment<kBlock>(at(cone.a));
  if (cone.b != FrictionCone::kFixed) out += cone.D_b * z.segment<kBlock>(at(cone.b));
  return out;
}

/// P (D z + slip).
Vector3d ConeProjection::slip(const FrictionCone& cone) const noexcept {
  const Vector3d moved = displacement(cone, z_);
  return moved - cone.n.dot(moved) * cone.n + cone.slip_m;
}

double ConeProjection::lift_m(std::size_t cone) const noexcept {
  return cones_[cone].mu > 0.0 ? cones_[cone].mu * slip(cones_[cone]).norm() : 0.0;
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
  out.bound = bound(out);
  return out;
}

double ConeProjection::bound(const HalfSpace& half_space) const noexcept {
  const FrictionCone& cone = cones_[half_space.cone];
  return ((cone.n - half_space.normal).dot(cone.slip_m) - cone.h_m - cone.s_m) / half_space.length;
}

/// Returns the product of the scaled normal of a half-space and z.
double ConeProjection::product(const HalfSpace& half_space, const Eigen::VectorXd& z) const noexcept {
  return half_space.normal.dot(displacement(cones_[half_space.cone], z)) / half_space.length;
}

/// Adds the change of z by a force of a cone.
void ConeProjection::push(const FrictionCone& cone, const Vector3d& force,
                          Eigen::VectorXd& z) const noexcept {
  if (cone.a != FrictionCone::kFixed) z.segment<kBlock>(at(cone.a)) += cone.D_a.transpose() * force;
  if (cone.b != FrictionCone::kFixed) z.segment<kBlock>(at(cone.b)) += cone.D_b.transpose() * force;
}

/// Finds the half-space that z violates most, in units of z. Returns false if no cone is violated by more
/// than the tolerance.
bool ConeProjection::most_violated(double tolerance_m, HalfSpace& worst) const noexcept {
  double most = 0.0;
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    const FrictionCone& cone = cones_[i];
    const Vector3d moved = displacement(cone, z_);
    const double normal_m = cone.n.dot(moved);
    const Vector3d slip = moved - normal_m * cone.n + cone.slip_m;
    const double length = slip.norm();
    const double violation_m = cone.mu * length - normal_m - cone.h_m - cone.s_m;
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
  steps_ = 0;
  start_with_suggested();
  const Status status = enter_violated(tolerance_m);
  take_forces();
  return status;
}

void ConeProjection::take_forces() noexcept {
  forces_.assign(cones_.size(), Vector3d::Zero());
  for (const HalfSpace& one : active_) forces_[one.cone] += one.multiplier / one.length * one.normal;
}

/// Makes violated half-spaces active until there is none.
ConeProjection::Status ConeProjection::enter_violated(double tolerance_m) noexcept {
  const std::size_t max_steps = steps_ + kMaxStepsPerUnknown * (dimension_ + cones_.size() + 1);
  HalfSpace worst;
  for (; steps_ < max_steps; ++steps_) {
    if (!most_violated(tolerance_m, worst)) return Status::optimal;
    if (!activate(worst)) return Status::infeasible;
  }
  return Status::budget_spent;
}

/// Makes the suggested half-spaces active, with their directions and the cones of this problem, and drops
/// those with a negative multiplier.
void ConeProjection::start_with_suggested() noexcept {
  active_.clear();
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
  drop_negative();
}

/// Recomputes z and the multipliers, and drops half-spaces with a negative one, the most negative first.
void ConeProjection::drop_negative() noexcept {
  for (;;) {
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
    r_[k] = (one.bound - product(one, z0_) - dot_column(k, k, r_)) / R_(k, k);
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    const Range& range = ranges_[static_cast<std::size_t>(k)];
    z_.segment(range.first, range.size) += r_[k] * Q_.col(k).segment(range.first, range.size);
  }
  back_substitute(r_, d_);
  for (Eigen::Index k = 0; k < count; ++k) active_[static_cast<std::size_t>(k)].multiplier = d_[k];
}

/// Makes a half-space active and drops those whose multiplier reaches zero, METHOD (33). Returns false if the
/// half-spaces contradict each other.
bool ConeProjection::activate(HalfSpace entering) noexcept {
  const auto size = static_cast<Eigen::Index>(dimension_);
  for (;;) {
    project_out(entering);
    back_substitute(r_, d_);
    const double curvature = dot(rest_.data(), rest_.data(), size);
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

/// Subtracts from rest_, the scaled normal of a half-space, its projection on the active normals; r_ receives
/// the coefficients on Q. Orthogonalises a second time if cancellation loses digits.
void ConeProjection::project_out(const HalfSpace& half_space) noexcept {
  constexpr double kLittleLost = 0.5;  // fraction of the squared length, which is 1
  const auto size = static_cast<Eigen::Index>(dimension_);
  const auto count = static_cast<Eigen::Index>(active_.size());
  const FrictionCone& cone = cones_[half_space.cone];
  rest_.head(size).setZero();
  push(cone, half_space.normal / half_space.length, rest_);
  rest_range_ = range_of(cone);
  for (Eigen::Index k = 0; k < count; ++k) {  // only two blocks of the normal are not zero
    const double* column = Q_.col(k).data();
    double c = 0.0;
    for (const std::size_t body : {cone.a, cone.b})
      if (body != FrictionCone::kFixed) c += dot(column + at(body), rest_.data() + at(body), kBlock);
    r_[k] = c;
  }
  for (Eigen::Index k = 0; k < count; ++k) subtract_column(k, r_[k]);
  const double left =
      dot(rest_.data() + rest_range_.first, rest_.data() + rest_range_.first, rest_range_.size);
  if (count == 0 || left > kLittleLost) return;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Range& of_column = ranges_[static_cast<std::size_t>(k)];
    const Eigen::Index first = std::max(of_column.first, rest_range_.first);
    const Eigen::Index end = std::min(of_column.first + of_column.size, rest_range_.first + rest_range_.size);
    d_[k] = first < end ? dot(Q_.col(k).data() + first, rest_.data() + first, end - first) : 0.0;
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    subtract_column(k, d_[k]);
    r_[k] += d_[k];
  }
}

/// Subtracts a multiple of a column of Q from rest_.
void ConeProjection::subtract_column(Eigen::Index k, double factor) noexcept {
  if (factor == 0.0) return;
  const Range& range = ranges_[static_cast<std::size_t>(k)];
  rest_.segment(range.first, range.size) -= factor * Q_.col(k).segment(range.first, range.size);
  rest_range_ = united(rest_range_, range);
}

void ConeProjection::back_substitute(const Eigen::VectorXd& r, Eigen::VectorXd& d) const noexcept {
  const auto count = static_cast<Eigen::Index>(active_.size());
  d.head(count) = r.head(count);
  for (Eigen::Index k = count; k-- > 0;) {  // by columns, which are contiguous
    d[k] /= R_(k, k);
    d.head(k) -= d[k] * R_.col(k).head(k);
  }
}

/// Product of the first `rows` of a column of R and x.
double ConeProjection::dot_column(Eigen::Index column, Eigen::Index rows,
                                  const Eigen::VectorXd& x) const noexcept {
  const Eigen::Index whole = rows - rows % 6;
  double sum = dot(R_.col(column).data(), x.data(), whole);
  for (Eigen::Index i = whole; i < rows; ++i) sum += R_(i, column) * x[i];
  return sum;
}

/// Appends a half-space whose normal is orthogonalised here. Returns false if it depends on the active ones.
bool ConeProjection::append(const HalfSpace& half_space) noexcept {
  if (active_.size() >= dimension_) return false;
  project_out(half_space);
  const double curvature = dot(rest_.data(), rest_.data(), static_cast<Eigen::Index>(dimension_));
  if (!(curvature > kDependent)) return false;
  append(half_space, std::sqrt(curvature));
  return true;
}

/// Appends a half-space whose normal is rest_ + Q r_.
void ConeProjection::append(const HalfSpace& half_space, double length) noexcept {
  const auto size = static_cast<Eigen::Index>(dimension_);
  const auto k = static_cast<Eigen::Index>(active_.size());
  Q_.col(k).head(size) = rest_.head(size) / length;
  ranges_[active_.size()] = rest_range_;
  R_.col(k).head(k) = r_.head(k);
  R_(k, k) = length;
  active_.push_back(half_space);
}

/// Removes the k-th active half-space. Rotations make R a triangle again.
void ConeProjection::drop(std::size_t dropped) noexcept {
  const auto first = static_cast<Eigen::Index>(dropped);
  active_.erase(active_.begin() + static_cast<std::ptrdiff_t>(dropped));
  const auto count = static_cast<Eigen::Index>(active_.size());
  for (Eigen::Index k = first; k < count; ++k) R_.col(k).head(k + 2) = R_.col(k + 1).head(k + 2);
  for (Eigen::Index k = first; k < count; ++k) {
    const double length = std::sqrt(R_(k, k) * R_(k, k) + R_(k + 1, k) * R_(k + 1, k));
    const double c = R_(k, k) / length, s = R_(k + 1, k) / length;
    R_(k, k) = length;
    for (Eigen::Index j = k + 1; j < count; ++j) rotate(c, s, R_(k, j), R_(k + 1, j));
    double* const a = Q_.col(k).data();
    double* const b = Q_.col(k + 1).data();
    Range& of_a = ranges_[static_cast<std::size_t>(k)];
    Range& of_b = ranges_[static_cast<std::size_t>(k) + 1];
    of_a = of_b = united(of_a, of_b);
    for (Eigen::Index i = of_a.first; i < of_a.first + of_a.size; ++i) rotate(c, s, a[i], b[i]);
  }
}

StaticVector<Vector3d, 4> ConeProjection::active_normals(std::size_t cone) const noexcept {
  StaticVector<Vector3d, 4> out;
  for (const HalfSpace& one : active_)
    if (one.cone == cone) out.add(one.normal);
  return out;
}

}  // namespace wrenchd
