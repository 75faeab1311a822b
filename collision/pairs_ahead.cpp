// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs_ahead.hpp"

#include <algorithm>
#include <utility>

namespace wrenchd {
namespace {

/// No list holds for less than this beside its way, in units of the tool's size; the first of all, when
/// nothing is known of the motion, for more.
constexpr double kLeastReach = 1e-4;
constexpr double kFirstReach = 1e-3;
/// What a list made at once holds for beside its way, as a share of it.
constexpr double kReach = 0.08;
/// The same for a list made ahead, beside the way expected.
constexpr double kReachAhead = 0.04;
/// One that leads where the tool is expected holds for so many ticks.
constexpr double kTicksAtOnce = 4.0;
/// The longest way that a list is made for ahead, and the widest reach, in units of the tool's size: it
/// serves for fewer ticks where the hand is faster. A hand that is faster still is followed at once.
constexpr double kFarthestAhead = 0.2;
constexpr double kWidestAhead = 0.02;
/// A list made ahead is to serve for so many ticks, at most and at least.
constexpr double kMostTicksAhead = 10.0;
constexpr double kLeastTicksAhead = 3.0;
/// It is made while the one before it serves, evenly, and a little sooner than it is needed; it holds from
/// half way there on.
constexpr double kHaste = 1.1;
/// It may take more than the one before: so much more is still to do where that is done, as a share of it.
constexpr double kUnforeseen = 0.2;
constexpr double kFrom = 0.5;
constexpr double kTo = 2.0;
/// A long list is dear to sieve, more than once in a tick where contacts change; a short one is often to be
/// made: where one costs so many times the other, the next is made for fewer ticks or for more.
constexpr double kSieved = 2.0;
constexpr double kTooDear = 1.5;
constexpr double kFewer = 0.7;
/// The least that is done with a tick, in visits.
constexpr double kLeastPortion = 32.0;
/// No list made at once takes more than this share of the budget that is left: a way that is too long for it
/// may be followed by a shorter one.
constexpr double kLongestWalk = 0.7;

std::uint32_t most_visits(const WalkBudget& budget) noexcept {
  return static_cast<std::uint32_t>(kLongestWalk * budget.visits);
}

/// Goes on with a list for no more than so many visits of the budget.
bool go_on(NearPairs& list, std::uint32_t visits, WalkBudget& budget) noexcept {
  WalkBudget part = {std::min(visits, budget.visits)};
  budget.visits -= part.visits;
  const bool ended = list.go_on(part);
  budget.visits += part.visits;
  return ended;
}

}  // namespace

PairsAhead::PairsAhead(const Scene& scene)
    : scene_(scene),
      lists_{NearPairs(scene), NearPairs(scene), NearPairs(scene)},
      ticks_ahead_(kMostTicksAhead) {}

bool PairsAhead::list(const Pose& X_start, const Pose& X_end, const Times& times,
                      WalkBudget& budget) noexcept {
  const auto holds = [&](const NearPairs& list) {
    return list.covers(X_end, times.end_s) && list.covers(X_start, times.start_s);
  };
  const auto will_hold = [&](const NearPairs& list) {
    return list.will_cover(X_end, times.end_s) && list.will_cover(X_start, times.start_s);
  };
  if (!holds(*listed_)) {
    if (ahead_->under_way() && will_hold(*ahead_)) {
      if (go_on(*ahead_, most_visits(budget), budget)) weigh();
    }
    if (holds(*ahead_)) {
      serve(ahead_);
    } else if (list_at_once(X_start, X_end, times, budget)) {
      ++made_at_once_;
      serve(spare_);
      astray_ = true;
    } else {
      return false;
    }
  }
  return true;
}

/// For as long as it takes to make the next list, if the way leads where the tool is expected; else for this
/// way alone. Whether the way expected holds this one for obstacles that move too is not looked at.
bool PairsAhead::list_at_once(const Pose& X_start, const Pose& X_end, const Times& times,
                              WalkBudget& budget) noexcept {
  const double least_m = (motion_.known() ? kLeastReach : kFirstReach) * scene_.tool_radius_m();
  NearPairs::Way way = {X_start, X_end, std::max(kReach * listed().way_m(X_start, X_end), least_m),
                        times.start_s, times.end_s};
  if (!scene_.moves() && motion_.known()) {
    const NearPairs::Way expected = way_ahead(0.0, kTicksAtOnce);
    const auto holds = [&](const Pose& X) { return listed().away_m(expected, X) <= expected.reach_m; };
    if (goes_slowly(expected) && holds(X_start) && holds(X_end)) way = expected;
  }
  spare_->set_out(way);
  go_on(*spare_, most_visits(budget), budget);
  return spare_->complete();
}

void PairsAhead::look_ahead(const Pose& X_WT, const Pose& X_WP, WalkBudget& budget, double time_s) noexcept {
  motion_.learn(X_WT, X_WP);
  tick_s_ = time_s - last_s_;
  last_s_ = time_s;
  const double soon = ticks_to_serve();
  const Pose X_soon = motion_.after(soon);
  const double soon_s = time_s + soon * tick_s_;
  const bool astray = std::exchange(astray_, false) && !ahead_->will_cover(X_soon, soon_s);
  if (!ahead_->under_way() || astray) {
    if (listed_->covers(X_soon, soon_s) || ahead_->covers(X_soon, soon_s)) return;
    const NearPairs::Way way = way_ahead(kFrom * soon, kTo * soon);
    if (!goes_slowly(way)) return;
    if (ahead_->covers(X_WT, time_s)) serve(ahead_);  // it holds for longer than the one that serves
    ahead_->set_out(way);
  }
  if (go_on(*ahead_, portion(X_soon, soon), budget)) weigh();
}

/// What is to be done of the list ahead with this tick, in visits, so that it is done when the one that
/// serves no longer holds.
std::uint32_t PairsAhead::portion(const Pose& X_soon, double soon) const noexcept {
  double left = soon;  // ticks
  if (!scene_.moves()) {
    const double tick_m = listed().way_m(motion_.after(0.0), X_soon) / soon;
    const double beyond_m = std::max(-listed().room_m(X_soon), 0.0);
    left = std::max(1.0, tick_m > 0.0 ? soon - beyond_m / tick_m : soon);
  }
  const double expected = std::max(visits_of_list_, listed().visits());
  const double to_do = std::max(expected - ahead_->visits(), kUnforeseen * expected);
  return static_cast<std::uint32_t>(std::max(kHaste * to_do / left, kLeastPortion));
}

void PairsAhead::forget_motion() noexcept {
  motion_.forget();
}

/// How long the next list is to serve, by what this one took to make and takes to sieve.
void PairsAhead::weigh() noexcept {
  visits_of_list_ = ahead_->visits();
  const double sieving = kSieved * static_cast<double>(ahead_->pairs().size()) / kPairsPerVisit;
  const double making = visits_of_list_ / ticks_ahead_;
  if (!ahead_->complete() || sieving > kTooDear * making)
    ticks_ahead_ = std::max(kFewer * ticks_ahead_, kLeastTicksAhead);
  else if (making > kTooDear * sieving)
    ticks_ahead_ = std::min(ticks_ahead_ / kFewer, kMostTicksAhead);
}

void PairsAhead::serve(NearPairs*& list) noexcept {
  std::swap(listed_, list);
}

double PairsAhead::ticks_to_serve() const noexcept {
  const double far_m = listed().way_m(motion_.after(0.0), motion_.after(ticks_ahead_));
  const double farthest_m = kFarthestAhead * scene_.tool_radius_m() / (kTo - kFrom);
  return std::max(1.0, far_m > farthest_m ? ticks_ahead_ * farthest_m / far_m : ticks_ahead_);
}

NearPairs::Way PairsAhead::way_ahead(double from_ticks, double to_ticks) const noexcept {
  const double r_m = scene_.tool_radius_m(), ticks = to_ticks - from_ticks;
  const Pose X_near = motion_.after(from_ticks), X_far = motion_.after(to_ticks);
  const double way_m = listed().way_m(motion_.after(0.0), X_far);  // what is expected may be wrong all along
  const double reach_m = std::max(kReachAhead * way_m + motion_.bend_m(ticks, r_m), kLeastReach * r_m);
  return {X_near, X_far, reach_m, last_s_ + from_ticks * tick_s_, last_s_ + to_ticks * tick_s_};
}

bool PairsAhead::goes_slowly(const NearPairs::Way& way) const noexcept {
  const double r_m = scene_.tool_radius_m();
  return listed().way_m(way.X_WT_start, way.X_WT_end) <= kFarthestAhead * r_m &&
         way.reach_m <= kWidestAhead * r_m;
}

}  // namespace wrenchd
