// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/work_account.hpp"

#include <algorithm>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Factor on the reserve. The balance falls with a delay; e or more keeps it from falling below zero.
constexpr double kReserveFactor = 3.0;

}  // namespace

WorkAccount::WorkAccount(const WorkAccountLoop& loop) noexcept : loop_(loop) {
  loop_.delay_ticks = std::min(loop_.delay_ticks, kMaxDelay_ticks);
}

void WorkAccount::reset() noexcept {
  *this = WorkAccount(loop_);
}

void WorkAccount::deposit(double energy_J) noexcept {
  if (!is_finite(energy_J) || energy_J <= 0.0) return;
  balance_J_ = std::min(balance_J_ + energy_J, kMaxBalance_J);
}

Wrench WorkAccount::permit(const Wrench& requested_B, const Pose& X_BH, double sample_dt_s,
                           double tick_s) noexcept {
  const bool valid = is_finite(requested_B) && is_finite(X_BH) && is_finite(sample_dt_s) &&
                     is_finite(tick_s) && tick_s > 0.0;
  if (valid && sample_dt_s > 0.0 && has_pose_) {
    const Motion step = {X_BH.translation_m - X_BH_.translation_m,
                         rotation_vector(X_BH.rotation * X_BH_.rotation.conjugate())};
    speed_m_per_s_ = step.displacement_m.norm() / sample_dt_s;
    speed_rad_per_s_ = step.rotation_rad.norm() / sample_dt_s;
    balance_J_ = std::min(balance_J_ - work_bound_J(step), kMaxBalance_J);
  }
  if (valid && (sample_dt_s > 0.0 || !has_pose_)) {
    X_BH_ = X_BH;
    has_pose_ = true;
    ticks_since_sample_ = 0;
  }
  ++ticks_since_sample_;
  const double reserve = valid ? reserve_J(requested_B, tick_s) : 0.0;
  const double share =
      reserve > 0.0 && balance_J_ > 0.0 && has_pose_ ? std::min(balance_J_ / reserve, 1.0) : 0.0;
  ++tick_;
  return sent_[tick_ % kHistory] = valid ? share * requested_B : Wrench{};
}

/// Each change of the wrench can be half an encoder step away from where it seems to be: METHOD (121).
void WorkAccount::record_sent(const Wrench& sent_B) noexcept {
  Wrench& newest = sent_[tick_ % kHistory];
  newest = is_finite(sent_B) ? sent_B : Wrench{};
  const Wrench change = newest - sent(1);
  balance_J_ -= 0.5 * (change.force_N.lpNorm<1>() * loop_.step.linear_m +
                       change.torque_Nm.lpNorm<1>() * loop_.step.angular_rad);
}

std::size_t WorkAccount::window() const noexcept {
  return std::min(loop_.delay_ticks + ticks_since_sample_, kHistory - 1);
}

void WorkAccount::close() noexcept {
  for (std::size_t ago = 0; ago < window(); ++ago)
    if (!sent(ago).force_N.isZero(0.0) || !sent(ago).torque_Nm.isZero(0.0)) return;
  balance_J_ = std::min(balance_J_, 0.0);
}

/// METHOD (119): the most that any wrench which may have acted since the previous sample can have given.
double WorkAccount::work_bound_J(const Motion& step) const noexcept {
  const auto work = [&](const Wrench& F) {
    return F.force_N.dot(step.displacement_m) + F.torque_Nm.dot(step.rotation_rad);
  };
  double most_J = work(sent(0));
  for (std::size_t ago = 1; ago < window(); ++ago) most_J = std::max(most_J, work(sent(ago)));
  return most_J;
}

/// METHOD (120): the work that a wrench can give before its decrease acts.
double WorkAccount::reserve_J(const Wrench& F, double tick_s) const noexcept {
  const double window_s = static_cast<double>(loop_.delay_ticks + ticks_since_sample_) * tick_s;
  const double speed_m_per_s = speed_m_per_s_ + kMaxAcceleration_m_per_s2 * window_s;
  const double speed_rad_per_s = speed_rad_per_s_ + kMaxAcceleration_rad_per_s2 * window_s;
  return kReserveFactor * window_s *
         (F.force_N.norm() * speed_m_per_s + F.torque_Nm.norm() * speed_rad_per_s);
}

}  // namespace wrenchd
