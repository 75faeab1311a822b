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

void EvenWork::learn(std::uint32_t looks, double list, bool late) noexcept {
  lateness_ = late ? std::min(lateness_ + 1.0, kMostLate) : kForgotten * lateness_;
  if (list == 0.0 && late) return;  // it has not begun
  ++learned_;
  looks_ += std::max(kNewest, 1.0 / learned_) * (looks - looks_);
  list_ += std::max(kNewestList, 1.0 / learned_) * (list - list_);
}

double EvenWork::even() const noexcept {
  return kEvenLooks * looks_ + kEvenLists * list_;
}

std::uint32_t EvenWork::most(double haste) const noexcept {
  const double least = learned_ > 0.0 ? kAlways : kAtFirst;
  const double more = 1.0 + kAfterLate * std::max(lateness_ - kFewLate, 0.0);
  const double most = std::max(kMost * even(), least) * more * haste;
  return static_cast<std::uint32_t>(std::min(most, kFarTooMuch));
}

}  // namespace wrenchd
