// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/undriven_motion.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Ticks between two attempts of a handle without contact to take its whole lag in one step.
constexpr int kRetryTicks = 16;
/// Factor from the motion in the last delay to a bound on the motion in the next one.
constexpr double kReachFactor = 1.5;

Vector6d numbers(const Wrench& F) noexcept {
  Vector6d x;
  x << F.force_N, F.torque_Nm;
  return x;
}

Vector6d masked(Vector6d x, DofMask dofs) noexcept {
  for (unsigned i = 0; i < 6; ++i)
    if ((dofs >> i & 1u) == 0) x[i] = 0.0;
  return x;
}

/// K with rows and columns outside of dofs replaced by those of the identity.
Matrix6d masked(Matrix6d K, DofMask dofs) noexcept {
  for (unsigned i = 0; i < 6; ++i) {
    if ((dofs >> i & 1u) != 0) continue;
    K.row(i).setZero();
    K.col(i).setZero();
    K(i, i) = 1.0;
  }
  return K;
}

DofMask free_dofs(DofMask sensed, DofMask driven) noexcept {
  if (driven == kNoDof) return kNoDof;
  const auto undriven = static_cast<DofMask>(sensed & ~driven);
  const bool angular = (undriven & kAngularDofs) != 0;
  return static_cast<DofMask>((undriven & kLinearDofs) | (angular ? kAngularDofs : kNoDof));
}

Pose displaced(const Pose& X, const Vector6d& d) noexcept {
  return {(rotation_from(d.tail<3>()) * X.rotation).normalized(), X.translation_m + d.head<3>()};
}

}  // namespace

UndrivenMotion::UndrivenMotion(DofMask sensed, DofMask driven, const EncoderStep& step) noexcept
    : driven_(driven), free_(free_dofs(sensed, driven)), step_(step) {}

void UndrivenMotion::set_loop(const Matrix6d& K_H, double delay_s) noexcept {
  K_H_ = K_H;
  delay_s_ = delay_s;
}

void UndrivenMotion::reset(const Pose& X_BH) noexcept {
  X_BH_ = X_BH_used_ = X_BH;
  account_J_ = 0.0;
  wait_ = 0;
  path_count_ = pending_count_ = 0;
  started_ = true;
}

void UndrivenMotion::move_driven(const Pose& X_BH, double device_time_s) noexcept {
  if (!started_) reset(X_BH);
  Vector6d d;
  d << X_BH.translation_m - X_BH_.translation_m, rotation_vector(X_BH.rotation * X_BH_.rotation.conjugate());
  d = masked(d, driven_);
  X_BH_ = X_BH;
  if ((driven_ & kAngularDofs) != 0) X_BH_used_ = displaced(X_BH_used_, d);
  for (unsigned i = 0; i < 3; ++i)
    if ((free_ >> i & 1u) == 0) X_BH_used_.translation_m[i] = X_BH.translation_m[i];
  if ((free_ & kAngularDofs) == 0) X_BH_used_.rotation = X_BH.rotation;

  PathPoint now{device_time_s, d};
  if (path_count_ > 0) now.y += path_[(path_count_ - 1) % kHistory].y;
  path_[path_count_++ % kHistory] = now;
  settle(now);
}

/// METHOD (87f). A change of force acts within the delay after its sample; until then it counts at the worst
/// place that the hand passes.
void UndrivenMotion::settle(const PathPoint& now) noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pending_count_; ++i) {
    Pending p = pending_[i];
    p.worst_J = std::max(p.worst_J, -p.dF.dot(now.y - p.begin.y));
    if (now.time_s - p.begin.time_s > delay_s_)
      account_J_ += p.reserve_J - p.worst_J;
    else
      pending_[kept++] = p;
  }
  pending_count_ = kept;
}

Vector6d UndrivenMotion::lag() const noexcept {
  if (!started_) return Vector6d::Zero();
  Vector6d d;
  d << X_BH_.translation_m - X_BH_used_.translation_m,
      rotation_vector(X_BH_.rotation * X_BH_used_.rotation.conjugate());
  return masked(d, free_);
}

double UndrivenMotion::lag_rad() const noexcept {
  return lag().tail<3>().norm();
}

double UndrivenMotion::lag_m() const noexcept {
  return lag().head<3>().norm();
}

/// Bound on the energy that a change of force gives by acting late: the force change times half an encoder
/// step and times the motion that the hand may make until then.
double UndrivenMotion::late_work_bound_J(const Vector6d& dF) const noexcept {
  double linear_m = 0.0, angular_rad = 0.0;
  const PathPoint& now = path_[(path_count_ - 1) % kHistory];
  for (std::uint64_t i = 2; i <= std::min<std::uint64_t>(path_count_, kHistory); ++i) {
    const PathPoint& before = path_[(path_count_ - i) % kHistory];
    const Vector6d moved = now.y - before.y;
    linear_m = std::max(linear_m, moved.head<3>().norm());
    angular_rad = std::max(angular_rad, moved.tail<3>().norm());
    if (now.time_s - before.time_s > delay_s_) break;
  }
  return kReachFactor * (linear_m * dF.head<3>().norm() + angular_rad * dF.tail<3>().norm());
}

/// METHOD (87e): the displacement nearest to target in the metric K that the account can pay. The ball
///
///   U + g' d + 1/2 d' K d <= U + A
///
/// has the centre -K^-1 g.
Vector6d UndrivenMotion::affordable(const Vector6d& target, const SpringState& at) const noexcept {
  Matrix6d R = Matrix6d::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = X_BH_used_.rotation.toRotationMatrix();
  const Matrix6d K_B = R * K_H_ * R.transpose();
  const Matrix6d K = masked(K_B, free_);
  const Vector6d F = masked(numbers(at.F_B), free_);
  const Vector6d centre = K.ldlt().solve(F);
  const double available_J = account_J_ / share_;
  const double F_per_sqrt_J = std::sqrt(masked(K_B, driven_).cwiseAbs().rowwise().sum().maxCoeff());
  const auto late_J = [&](const Vector6d& d) {
    Vector6d dF = Vector6d::Zero();
    dF[0] = F_per_sqrt_J * std::sqrt(d.dot(K * d));
    return late_work_bound_J(dF) + 0.5 * step_.linear_m * dF[0];
  };
  const auto in_ball = [&](double budget_J) -> Vector6d {
    const double square = centre.dot(F) + 2.0 * budget_J;
    if (!(square > 0.0)) return Vector6d::Zero();
    const Vector6d outward = target - centre;
    const double distance = std::sqrt(outward.dot(K * outward));
    return centre + std::min(1.0, std::sqrt(square) / distance) * outward;
  };
  Vector6d d = in_ball(available_J);
  d = in_ball(available_J - late_J(d));
  const double a = 0.5 * d.dot(K * d), b = late_J(d) - F.dot(d);
  if (a + b <= available_J) return d;
  const double square = b * b + 4.0 * a * available_J;
  if (!(square >= 0.0) || !(a > 0.0)) return Vector6d::Zero();
  return std::clamp((std::sqrt(square) - b) / (2.0 * a), 0.0, 1.0) * d;
}

std::optional<Pose> UndrivenMotion::propose(const SpringState& at) noexcept {
  const Vector6d target = lag();
  if (!at.known || target.isZero(0.0)) return {};
  whole_ = (at.U_J == 0.0 && wait_ == 0) || share_ <= 0.0;
  const Vector6d d = whole_ ? target : affordable(target, at);
  if (d.isZero(0.0) || !is_finite(d.head<3>()) || !is_finite(d.tail<3>())) return {};
  return displaced(X_BH_used_, d);
}

/// METHOD (87d): pays for the step, or refuses it.
bool UndrivenMotion::accept(const Pose& X_BH, const SpringState& from, const SpringState& to) noexcept {
  const double dU_J = share_ * (to.U_J - from.U_J);
  const Vector6d dF = share_ * masked(numbers(to.F_B - from.F_B), driven_);
  const double step_J = 0.5 * (step_.linear_m * dF.head<3>().cwiseAbs().sum() +
                               step_.angular_rad * dF.tail<3>().cwiseAbs().sum());
  const double reserve_J = late_work_bound_J(dF);
  const double cost_J = dU_J + step_J + reserve_J;
  if (!to.known || cost_J > std::max(account_J_, 0.0)) {
    wait_ = kRetryTicks;
    return false;
  }
  account_J_ -= cost_J;
  X_BH_used_ = X_BH;
  if (!dF.isZero(0.0) && pending_count_ < kHistory)
    pending_[pending_count_++] = {path_[(path_count_ - 1) % kHistory], dF, reserve_J, 0.0};
  return true;
}

/// Credit of one contact does not serve the next. What is held back for changes of force that have not acted
/// yet is lost too; when all have acted, the account starts again.
void UndrivenMotion::finish(const SpringState& at) noexcept {
  if (wait_ > 0) --wait_;
  if (!at.known || at.U_J != 0.0) return;
  account_J_ = pending_count_ == 0 ? kInitialAccount_J : std::min(account_J_, kInitialAccount_J);
  for (std::size_t i = 0; i < pending_count_; ++i) pending_[i].reserve_J = 0.0;
}

}  // namespace wrenchd
