// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/work_balancer.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// How much the last tick counts among those before it, at least: for looks, which come and go, and for
/// lists.
constexpr double kNewest = 1.0 / 1024.0;
constexpr double kNewestList = 1.0 / 64.0;
/// Ticks are brought up to so many times what looks and what lists usually take: one tick looks once, another
/// several times, while lists are made evenly.
constexpr double kEvenLooks = 2.5;
constexpr double kEvenLists = 0.9;
/// What a tick may take, as a multiple of what all are brought up to. With less, lists are late so often that
/// they cost more.
constexpr double kMost = 2.0;
/// No tick is kept from so many visits, which take some thirty microseconds.
constexpr double kAlways = 250.0;
/// The same as long as nothing is known: a share of a millisecond.
constexpr double kAtFirst = 3000.0;
/// What is not done after so many late ticks has to be done for ever longer ways while the hand goes on: for
/// every further one the next may take so much more, as a share, and with every one that is not late that is
/// so much less.
constexpr double kFewLate = 4.0;
constexpr double kAfterLate = 0.5;
constexpr double kMostLate = 10.0;
constexpr double kForgotten = 0.8;
constexpr double kFarTooMuch = 1e9;

}  // namespace

void WorkBalancer::update(std::uint32_t looks, double list, bool late) noexcept {
  recent_deferrals_ = late ? std::min(recent_deferrals_ + 1.0, kMostLate) : kForgotten * recent_deferrals_;
  if (list == 0.0 && late) return;  // it has not begun
  ++ticks_;
  sweep_visits_ += std::max(kNewest, 1.0 / ticks_) * (looks - sweep_visits_);
  list_visits_ += std::max(kNewestList, 1.0 / ticks_) * (list - list_visits_);
}

double WorkBalancer::target_visits() const noexcept {
  return kEvenLooks * sweep_visits_ + kEvenLists * list_visits_;
}

std::uint32_t WorkBalancer::max_visits(double haste) const noexcept {
  const double least = ticks_ > 0.0 ? kAlways : kAtFirst;
  const double more = 1.0 + kAfterLate * std::max(recent_deferrals_ - kFewLate, 0.0);
  const double most = std::max(kMost * target_visits(), least) * more * haste;
  return static_cast<std::uint32_t>(std::min(most, kFarTooMuch));
}

}  // namespace wrenchd
