// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/work_balancer.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Minimum weight of the newest tick in the running means: for sweeps, which come and go, and for candidate
/// lists.
constexpr double kMinSweepWeight = 1.0 / 1024.0;
constexpr double kMinListWeight = 1.0 / 64.0;
/// The target is this multiple of the usual cost of sweeps and of lists. Some ticks sweep once and others
/// several times, whereas lists are built evenly.
constexpr double kSweepFactor = 2.5;
constexpr double kListFactor = 0.9;
/// The work limit as a multiple of the target. With a lower limit, lists are deferred so often that they cost
/// more.
constexpr double kLimitFactor = 2.0;
/// The limit is never lower than this [node visits], 0.5 to 0.8 ms. A deferral leaves the proxy behind the
/// hand for a tick, so only work that endangers the period is deferred.
constexpr double kMinLimit_visits = 7000.0;
/// If work is deferred over several ticks, the hand moves on and the paths become longer. For each deferred
/// tick beyond kToleratedDeferrals the limit grows by the fraction kGrowthPerDeferral. A tick without
/// deferral reduces the count by the factor kDecay.
constexpr double kToleratedDeferrals = 4.0;
constexpr double kGrowthPerDeferral = 0.5;
constexpr double kMaxDeferrals = 10.0;
constexpr double kDecay = 0.8;
constexpr double kMaxLimit_visits = 1e9;

}  // namespace

void WorkBalancer::update(std::uint32_t sweep_visits, double list_visits, bool deferred) noexcept {
  recent_deferrals_ =
      deferred ? std::min(recent_deferrals_ + 1.0, kMaxDeferrals) : kDecay * recent_deferrals_;
  if (list_visits == 0.0 && deferred) return;  // no candidate list exists yet
  ++ticks_;
  sweep_visits_ += std::max(kMinSweepWeight, 1.0 / ticks_) * (sweep_visits - sweep_visits_);
  list_visits_ += std::max(kMinListWeight, 1.0 / ticks_) * (list_visits - list_visits_);
}

double WorkBalancer::target_visits() const noexcept {
  return kSweepFactor * sweep_visits_ + kListFactor * list_visits_;
}

std::uint32_t WorkBalancer::max_visits(double urgency) const noexcept {
  const double growth = 1.0 + kGrowthPerDeferral * std::max(recent_deferrals_ - kToleratedDeferrals, 0.0);
  const double limit = std::max(kLimitFactor * target_visits(), kMinLimit_visits) * growth * urgency;
  return static_cast<std::uint32_t>(std::min(limit, kMaxLimit_visits));
}

}  // namespace wrenchd
