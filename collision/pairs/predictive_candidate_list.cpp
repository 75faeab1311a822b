// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/predictive_candidate_list.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace wrenchd {
namespace {

/// No list holds for less than this beside its way, in units of the tool's size; the first of all, when
/// nothing is known of the motion, for more.
constexpr double kLeastReach = 1e-4;
constexpr double kFirstReach = 1e-3;
/// What a list made at once holds for beside its way, as a share of it.
constexpr double kReach = 0.08;
/// The same for a list made ahead, beside the way expected. One that takes more than so many visits holds for
/// less, by their square root, down to the least: there it is the reach that makes it long.
constexpr double kReachAhead = 0.12;
constexpr double kLeastReachAhead = 0.04;
constexpr double kDear = 2500.0;
/// A tool that was not where it was expected is expected less surely: with every time lists ahead hold for so
/// much more beside the way, up to so many times, and with every tick that it was there for a little less.
constexpr double kLessSurely = 1.5;
constexpr double kLeastSurely = 8.0;
constexpr double kMoreSurely = 0.98;
/// One that leads where the tool is expected holds for so many ticks.
constexpr double kTicksAtOnce = 2.0;
/// The longest way that a list is made for ahead, and the widest reach, in units of the tool's size: it
/// serves for fewer ticks where the hand is faster. A hand that is faster still is followed at once.
constexpr double kFarthestAhead = 0.2;
constexpr double kWidestAhead = 0.02;
/// A list made ahead is to serve for so many ticks, at most and at least.
constexpr double kMostTicksAhead = 7.0;
constexpr double kLeastTicksAhead = 3.0;
/// It is made while the one before it serves, evenly, and a little sooner than it is needed.
constexpr double kHaste = 1.1;
/// It may take more than the one before: so much more is still to do where that is done, as a share of it.
constexpr double kUnforeseen = 0.2;
/// It holds from half way there on, or from where the one before it no longer does, to twice as far as there.
constexpr double kFrom = 0.5;
constexpr double kTo = 2.0;
/// One made at once is taken to need this share of what the one that serves took, before any was made.
constexpr double kAtOnce = 0.5;
/// A long list is dear to sieve, more than once in a tick where contacts change; a short one is often to be
/// made: where one costs so many times the other, the next is made for fewer ticks or for more.
constexpr double kSieved = 2.0;
constexpr double kTooDear = 1.5;
constexpr double kFewer = 0.7;
/// One with so many times the pairs of the one that serves, where these are not few, is given up for one that
/// is to serve for fewer ticks: the motion was not known well enough for it.
constexpr double kFarMore = 1.7;
constexpr double kFew = 500.0;
constexpr double kFarFewer = 0.5;
/// A list that is late is gone on with where it holds for so much more of the way than what serves. It holds
/// for the way that was asked for first, with some room beside it.
constexpr double kLeadsOn = 0.01;
constexpr double kBesideWay = 1.2;
/// The least that is done with a tick, in visits.
constexpr double kLeastPortion = 32.0;
/// No list made at once takes more than this share of the budget that is left: a way that is too long for it
/// may be followed by a shorter one.
constexpr double kLongestWalk = 0.7;

/// What can wait takes what there is for it.
std::uint32_t most_visits(const VisitBudget& budget) noexcept {
  if (budget.reserved > 0) return budget.remaining - std::min(budget.remaining, budget.reserved);
  return static_cast<std::uint32_t>(kLongestWalk * budget.remaining);
}

/// Goes on with a list for no more than so many visits of the budget.
bool go_on(CandidatePairs& list, std::uint32_t visits, VisitBudget& budget) noexcept {
  VisitBudget part = {std::min(visits, budget.remaining)};
  budget.remaining -= part.remaining;
  const bool ended = list.resume(part);
  budget.remaining += part.remaining;
  return ended;
}

}  // namespace

PredictiveCandidateList::PredictiveCandidateList(const Scene& scene)
    : scene_(scene),
      lists_{CandidatePairs(scene), CandidatePairs(scene), CandidatePairs(scene)},
      horizon_ticks_(kMostTicksAhead) {}

bool PredictiveCandidateList::ensure_covers(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                                            VisitBudget& budget) noexcept {
  const auto holds = [&](const CandidatePairs& list) {
    return list.covers(X_end, times.end_s) && list.covers(X_start, times.start_s);
  };
  const auto will_hold = [&](const CandidatePairs& list) {
    return list.will_cover(X_end, times.end_s) && list.will_cover(X_start, times.start_s);
  };
  list_pending_ = false;
  if (holds(*current_)) return true;
  if (next_->in_progress() && will_hold(*next_) && next_list_is_cheaper(most_visits(budget))) {
    if (go_on(*next_, most_visits(budget), budget)) adapt_horizon();
    if (next_->in_progress() && budget.reserved > 0) return defer();
  }
  if (holds(*next_)) {
    make_current(next_);
    next_->clear();  // it has served
    return true;
  }
  if (!build_immediately(X_start, X_end, times, budget)) return false;
  ++immediate_lists_;
  immediate_cost_visits_ = spare_->node_visits();
  make_current(spare_);
  const bool ahead_is_there = next_->in_progress() || next_->complete();
  mispredicted_ = mispredicted_ || (ahead_is_there && !next_->will_cover(X_end, times.end_s));
  return holds(*current_);  // one that was late was made for where the tool was to go then
}

/// Is what is left of the list ahead sooner made than another at once? Not where it would take more than so
/// many visits, and the other would not.
bool PredictiveCandidateList::next_list_is_cheaper(std::uint32_t most) const noexcept {
  const double at_once =
      immediate_cost_visits_ > 0 ? immediate_cost_visits_ : kAtOnce * current().node_visits();
  return remaining_visits() <= most || at_once > most;
}

/// What the list ahead takes yet, in visits.
double PredictiveCandidateList::remaining_visits() const noexcept {
  const double expected = std::max(prefetch_cost_visits_, current().node_visits());
  return std::max(expected - next_->node_visits(), kUnforeseen * expected);
}

bool PredictiveCandidateList::defer() noexcept {
  list_pending_ = deferred_tick_ = true;
  return false;
}

/// One that was late already is gone on with, if it leads on.
bool PredictiveCandidateList::build_immediately(const Pose& X_start, const Pose& X_end,
                                                const PathTimes& times, VisitBudget& budget) noexcept {
  const std::uint32_t most = most_visits(budget);
  const bool waits = budget.reserved > 0;
  if (waits && most < kLeastPortion) return defer();
  const bool begun = waits && spare_->in_progress() &&
                     covered_fraction_of(*spare_, X_start, X_end) >
                         covered_fraction_of(*current_, X_start, X_end) + kLeadsOn;
  if (!begun) {
    const double ticks =
        waits && current().node_visits() > most ? static_cast<double>(current().node_visits()) / most : 0.0;
    spare_->start(immediate_path(X_start, X_end, times, std::log2(1.0 + ticks)));
  }
  go_on(*spare_, most, budget);
  if (waits && spare_->in_progress()) return defer();
  return spare_->complete();
}

/// For as long as it takes to make the next list, if the way leads where the tool is expected; else for this
/// way alone. One that will be late is made for as much longer as the hand will have gone on by then. Whether
/// the way expected holds this one for obstacles that move too is not looked at.
CandidatePairs::Path PredictiveCandidateList::immediate_path(const Pose& X_start, const Pose& X_end,
                                                             const PathTimes& times,
                                                             double wait_ticks) const noexcept {
  const double least_m = (predictor_.has_observation() ? kLeastReach : kFirstReach) * scene_.tool_radius_m();
  CandidatePairs::Path way = {X_start, X_end,
                              std::max(kReach * current().displacement_bound_m(X_start, X_end), least_m),
                              times.start_s, times.end_s};
  if (scene_.has_moving_obstacles() || !predictor_.has_observation()) return way;
  if (wait_ticks > 0.0) {
    const Pose X_now = predictor_.predict(0.0), X_then = predictor_.predict(wait_ticks + kTicksAtOnce);
    way.X_WT_end = {(X_then.rotation * X_now.rotation.conjugate() * X_end.rotation).normalized(),
                    X_end.translation_m + X_then.translation_m - X_now.translation_m};
    way.reach_m = std::max({kReach * current().displacement_bound_m(X_start, way.X_WT_end), least_m,
                            kBesideWay * current().distance_m(way, X_end)});
    return way;
  }
  const CandidatePairs::Path expected = predicted_path(0.0, kTicksAtOnce);
  const auto holds = [&](const Pose& X) { return current().distance_m(expected, X) <= expected.reach_m; };
  return within_prefetch_limits(expected) && holds(X_start) && holds(X_end) ? expected : way;
}

/// The start must be among what the list holds for. A list holds for the whole of a way if for its ends.
double PredictiveCandidateList::covered_fraction_of(const CandidatePairs& list, const Pose& X_start,
                                                    const Pose& X_end) const noexcept {
  constexpr int kHalvings = 7;
  if (!list.will_cover(X_start)) return 0.0;
  if (list.will_cover(X_end)) return 1.0;
  double share = 0.0, beyond = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (share + beyond);
    const Pose X = {X_start.rotation.slerp(middle, X_end.rotation),
                    X_start.translation_m + middle * (X_end.translation_m - X_start.translation_m)};
    (list.will_cover(X) ? share : beyond) = middle;
  }
  return share;
}

void PredictiveCandidateList::prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s,
                                       std::uint32_t to_spare) noexcept {
  if (std::exchange(deferred_tick_, false))
    predictor_.observe_deferred(X_WP);
  else
    predictor_.observe(X_WT, X_WP);
  tick_duration_s_ = time_s - last_scene_time_s_;
  last_scene_time_s_ = time_s;
  const double soon = service_ticks();
  const Pose X_soon = predictor_.predict(soon);
  const double soon_s = time_s + soon * tick_duration_s_;
  reach_scale_ = mispredicted_ ? std::min(kLessSurely * reach_scale_, kLeastSurely)
                               : std::max(kMoreSurely * reach_scale_, 1.0);
  const bool astray = std::exchange(mispredicted_, false) && !next_->will_cover(X_soon, soon_s);
  if (!next_->in_progress() || astray) {
    if (next_list_unneeded(X_WT, soon, time_s, to_spare > 0)) return;
    const CandidatePairs::Path way = predicted_path(valid_for_ticks(kFrom * soon, time_s), kTo * soon);
    if (!within_prefetch_limits(way)) return;
    if (next_->covers(X_WT, time_s)) make_current(next_);  // it holds for longer than the one that serves
    next_->start(way);
  }
  const std::uint32_t visits = std::max(visits_this_tick(X_soon, soon), to_spare);
  if (go_on(*next_, budget.reserved > 0 ? std::min(visits, most_visits(budget)) : visits, budget))
    adapt_horizon();
  if (horizon_ticks_ > kLeastTicksAhead &&
      static_cast<double>(next_->pairs().size()) >
          kFarMore * static_cast<double>(current().pairs().size()) + kFew) {
    horizon_ticks_ = std::max(kFarFewer * horizon_ticks_, kLeastTicksAhead);
    next_->clear();
  }
}

/// For how many ticks yet the list that serves holds, if the tool goes where it is expected; so many at most.
double PredictiveCandidateList::valid_for_ticks(double most, double time_s) const noexcept {
  double ticks = 0.0;
  while (ticks < most &&
         current_->covers(predictor_.predict(ticks + 1.0), time_s + (ticks + 1.0) * tick_duration_s_))
    ++ticks;
  return std::min(ticks, most);
}

/// Is there no list to be begun now? With work to spare the next is begun as soon as the last is made, if it
/// leads on: the younger a list, the better the motion was known.
bool PredictiveCandidateList::next_list_unneeded(const Pose& X_WT, double soon, double time_s,
                                                 bool to_spare) const noexcept {
  const auto covers = [&](const CandidatePairs& list, double ticks) {
    return list.covers(predictor_.predict(ticks), time_s + ticks * tick_duration_s_);
  };
  if (!to_spare) return covers(*current_, soon) || covers(*next_, soon);
  return covers(*current_, kTo * soon) || (covers(*next_, soon) && !next_->covers(X_WT, time_s));
}

/// What is to be done of the list ahead with this tick, in visits, so that it is done when the one that
/// serves no longer holds.
std::uint32_t PredictiveCandidateList::visits_this_tick(const Pose& X_soon, double soon) const noexcept {
  double left = soon;  // ticks
  if (!scene_.has_moving_obstacles()) {
    const double tick_m = current().displacement_bound_m(predictor_.predict(0.0), X_soon) / soon;
    const double beyond_m = std::max(-current().margin_m(X_soon), 0.0);
    left = std::max(1.0, tick_m > 0.0 ? soon - beyond_m / tick_m : soon);
  }
  return static_cast<std::uint32_t>(std::max(kHaste * remaining_visits() / left, kLeastPortion));
}

void PredictiveCandidateList::reset() noexcept {
  predictor_.reset();
  for (CandidatePairs& list : lists_) list.clear();
  mispredicted_ = list_pending_ = deferred_tick_ = false;
  prefetch_cost_visits_ = immediate_cost_visits_ = 0;
  horizon_ticks_ = kMostTicksAhead;
  reach_scale_ = 1.0;
}

/// How long the next list is to serve, by what this one took to make and takes to sieve.
void PredictiveCandidateList::adapt_horizon() noexcept {
  prefetch_cost_visits_ = next_->node_visits();
  const double sieving = kSieved * static_cast<double>(next_->pairs().size()) / kPairsPerVisit;
  const double making = prefetch_cost_visits_ / horizon_ticks_;
  if (!next_->complete() || sieving > kTooDear * making)
    horizon_ticks_ = std::max(kFewer * horizon_ticks_, kLeastTicksAhead);
  else if (making > kTooDear * sieving)
    horizon_ticks_ = std::min(horizon_ticks_ / kFewer, kMostTicksAhead);
}

void PredictiveCandidateList::make_current(CandidatePairs*& list) noexcept {
  std::swap(current_, list);
}

double PredictiveCandidateList::service_ticks() const noexcept {
  const double far_m =
      current().displacement_bound_m(predictor_.predict(0.0), predictor_.predict(horizon_ticks_));
  const double farthest_m = kFarthestAhead * scene_.tool_radius_m() / (kTo - kFrom);
  return std::max(1.0, far_m > farthest_m ? horizon_ticks_ * farthest_m / far_m : horizon_ticks_);
}

CandidatePairs::Path PredictiveCandidateList::predicted_path(double from_ticks,
                                                             double to_ticks) const noexcept {
  const double r_m = scene_.tool_radius_m(), ticks = to_ticks - from_ticks;
  const Pose X_near = predictor_.predict(from_ticks), X_far = predictor_.predict(to_ticks);
  const double way_m = current().displacement_bound_m(predictor_.predict(0.0),
                                                      X_far);  // what is expected may be wrong all along
  const bool dear = prefetch_cost_visits_ > kDear;
  const double less = dear ? std::sqrt(kDear / prefetch_cost_visits_) : 1.0;
  double reach_m =
      std::max(less * kReachAhead, kLeastReachAhead) * way_m + predictor_.chord_deviation_m(ticks, r_m);
  if (!dear) reach_m = std::max(reach_m, std::min(reach_scale_ * reach_m, kWidestAhead * r_m));
  reach_m = std::max(reach_m, reach_scale_ * kLeastReach * r_m);
  return {X_near, X_far, reach_m, last_scene_time_s_ + from_ticks * tick_duration_s_,
          last_scene_time_s_ + to_ticks * tick_duration_s_};
}

bool PredictiveCandidateList::within_prefetch_limits(const CandidatePairs::Path& way) const noexcept {
  const double r_m = scene_.tool_radius_m();
  return current().displacement_bound_m(way.X_WT_start, way.X_WT_end) <= kFarthestAhead * r_m &&
         way.reach_m <= kWidestAhead * r_m;
}

}  // namespace wrenchd
