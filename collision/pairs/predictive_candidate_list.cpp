// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/predictive_candidate_list.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace wrenchd {
namespace {

/// Minimum reach of a list, in units of the tool's size, and the larger minimum of the first list, which has
/// no prediction.
constexpr double kMinReach = 1e-4;
constexpr double kInitialReach = 1e-3;
/// Reach of an immediate list, as a fraction of its path.
constexpr double kImmediateReach = 0.08;
/// Reach of a prefetched list, as a fraction of the predicted path. If a list costs more than
/// kExpensive_visits, its reach shrinks with the square root of the cost, down to kMinPrefetchReach. The
/// reach dominates the cost of such lists.
constexpr double kPrefetchReach = 0.12;
constexpr double kMinPrefetchReach = 0.04;
constexpr double kExpensive_visits = 2500.0;
/// The reach grows by the factor kReachGrowth with each wrong prediction, up to kMaxReachScale times. It
/// shrinks by the factor kReachDecay with each correct one.
constexpr double kReachGrowth = 1.5;
constexpr double kMaxReachScale = 8.0;
constexpr double kReachDecay = 0.98;
/// An immediate list along the predicted path covers this number of ticks.
constexpr double kImmediateTicks = 2.0;
/// Longest path and largest reach of a prefetched list, in units of the tool's size. A faster hand gets lists
/// for fewer ticks. If the hand is even faster, every list is built immediately.
constexpr double kMaxPrefetchPath = 0.2;
constexpr double kMaxPrefetchReach = 0.02;
/// Maximum and minimum number of ticks that a prefetched list shall serve.
constexpr double kMaxHorizon_ticks = 7.0;
constexpr double kMinHorizon_ticks = 3.0;
/// A prefetched list is built evenly while the previous one is in use. This factor completes it a little
/// early.
constexpr double kBuildMargin = 1.1;
/// A list may cost more than the previous one. This fraction of the expected cost remains even if the
/// expected cost is spent.
constexpr double kMinRemainder = 0.2;
/// A prefetched list starts half way to the end of the current one, or where the current list ends, and
/// reaches twice as far.
constexpr double kPathBegin = 0.5;
constexpr double kPathEnd = 2.0;
/// Expected cost of the first immediate list, as a fraction of the cost of the current list.
constexpr double kFirstImmediateCost = 0.5;
/// A long list is expensive to cull, more than once per tick if contacts change. A short list must be built
/// often. If one cost exceeds the other by kCostRatio, the horizon of the next list changes by the factor
/// kHorizonFactor.
constexpr double kCullsPerTick = 2.0;
constexpr double kCostRatio = 1.5;
constexpr double kHorizonFactor = 0.7;
/// A list with this multiple of the current list's pairs is discarded, unless the numbers are small. The
/// motion was not known well enough. The next list has a shorter horizon.
constexpr double kMaxGrowth = 1.7;
constexpr double kSmallList_pairs = 500.0;
constexpr double kHorizonCut = 0.5;
/// A pending list continues only if it covers this much more of the path than the current list. A pending
/// list covers the path that was requested first, with a margin.
constexpr double kMinGain = 0.01;
constexpr double kPathMargin = 1.2;
/// Minimum work on a list per tick [node visits].
constexpr double kMinWork_visits = 32.0;
/// An immediate list uses at most this fraction of the remaining budget. If a path is too long for it, the
/// caller may try a shorter path.
constexpr double kMaxBudgetFraction = 0.7;

/// Returns the budget for work that may be deferred.
std::uint32_t allowed_visits(const VisitBudget& budget) noexcept {
  if (budget.reserved > 0) return budget.remaining - std::min(budget.remaining, budget.reserved);
  return static_cast<std::uint32_t>(kMaxBudgetFraction * budget.remaining);
}

/// Continues a list with at most `visits` node visits of the budget.
bool continue_list(CandidatePairs& list, std::uint32_t visits, VisitBudget& budget) noexcept {
  VisitBudget part = {std::min(visits, budget.remaining)};
  budget.remaining -= part.remaining;
  const bool ended = list.resume(part);
  budget.remaining += part.remaining;
  return ended;
}

}  // namespace

PredictiveCandidateList::PredictiveCandidateList(const Scene& scene, bool motion_is_continuous)
    : scene_(scene),
      sides_(scene, motion_is_continuous),
      lists_{CandidatePairs(scene, &sides_), CandidatePairs(scene, &sides_), CandidatePairs(scene, &sides_)},
      horizon_ticks_(kMaxHorizon_ticks) {}

bool PredictiveCandidateList::ensure_covers(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                                            VisitBudget& budget) noexcept {
  const auto covers = [&](const CandidatePairs& list) {
    return list.covers(X_end, times.end_s) && list.covers(X_start, times.start_s);
  };
  const auto will_cover = [&](const CandidatePairs& list) {
    return list.will_cover(X_end, times.end_s) && list.will_cover(X_start, times.start_s);
  };
  sides_.set_admissible(X_start, times.start_s);
  list_pending_ = false;
  if (covers(*current_)) return true;
  if (next_->in_progress() && will_cover(*next_) && next_list_is_cheaper(allowed_visits(budget))) {
    if (continue_list(*next_, allowed_visits(budget), budget)) adapt_horizon();
    if (next_->in_progress() && budget.reserved > 0) return defer();
  }
  if (covers(*next_)) {
    make_current(next_);
    next_->clear();  // the list has been used
    return true;
  }
  if (!build_immediately(X_start, X_end, times, budget)) return false;
  ++immediate_lists_;
  immediate_cost_visits_ = spare_->node_visits();
  make_current(spare_);
  const bool has_next = next_->in_progress() || next_->complete();
  mispredicted_ = mispredicted_ || (has_next && !next_->will_cover(X_end, times.end_s));
  return covers(*current_);  // a pending list was built for an earlier goal
}

/// Returns true if the next list can be completed at lower cost than an immediate list. False if it needs
/// more than max_visits and an immediate list does not.
bool PredictiveCandidateList::next_list_is_cheaper(std::uint32_t max_visits) const noexcept {
  const double immediate =
      immediate_cost_visits_ > 0 ? immediate_cost_visits_ : kFirstImmediateCost * current().node_visits();
  return remaining_visits() <= max_visits || immediate > max_visits;
}

/// Returns the estimated remaining cost of the next list [node visits].
double PredictiveCandidateList::remaining_visits() const noexcept {
  const double expected = std::max(prefetch_cost_visits_, current().node_visits());
  return std::max(expected - next_->node_visits(), kMinRemainder * expected);
}

bool PredictiveCandidateList::defer() noexcept {
  list_pending_ = deferred_tick_ = true;
  return false;
}

/// Continues a pending list if it covers more of the path than the current list.
bool PredictiveCandidateList::build_immediately(const Pose& X_start, const Pose& X_end,
                                                const PathTimes& times, VisitBudget& budget) noexcept {
  const std::uint32_t max_visits = allowed_visits(budget);
  const bool deferrable = budget.reserved > 0;
  if (deferrable && max_visits < kMinWork_visits) return defer();
  // If a list exceeds the budget of one tick, the next tick continues it. Otherwise every tick would spend
  // its budget on the same part of the list.
  const bool continues = !scene_.has_moving_obstacles() && spare_->in_progress() &&
                         covered_fraction_of(*spare_, X_start, X_end) >
                             covered_fraction_of(*current_, X_start, X_end) + kMinGain;
  if (!continues) {
    const double ticks = deferrable && current().node_visits() > max_visits
                             ? static_cast<double>(current().node_visits()) / max_visits
                             : 0.0;
    spare_->start(immediate_path(X_start, X_end, times, std::log2(1.0 + ticks)));
  }
  continue_list(*spare_, max_visits, budget);
  if (deferrable && spare_->in_progress()) return defer();
  return spare_->complete();
}

/// Returns the predicted path for the next ticks if it contains the given path, otherwise the given path. A
/// list that will be deferred covers the hand's motion during the delay too. The relative motion of obstacles
/// is not considered.
CandidatePairs::Path PredictiveCandidateList::immediate_path(const Pose& X_start, const Pose& X_end,
                                                             const PathTimes& times,
                                                             double delay_ticks) const noexcept {
  const double min_reach_m =
      (predictor_.has_observation() ? kMinReach : kInitialReach) * scene_.tool_radius_m();
  CandidatePairs::Path path = {
      X_start, X_end, std::max(kImmediateReach * current().displacement_bound_m(X_start, X_end), min_reach_m),
      times.start_s, times.end_s};
  if (scene_.has_moving_obstacles() || !predictor_.has_observation()) return path;
  if (delay_ticks > 0.0) {
    const Pose X_now = predictor_.predict(0.0), X_then = predictor_.predict(delay_ticks + kImmediateTicks);
    path.X_WT_end = {(X_then.rotation * X_now.rotation.conjugate() * X_end.rotation).normalized(),
                     X_end.translation_m + X_then.translation_m - X_now.translation_m};
    path.reach_m = std::max({kImmediateReach * current().displacement_bound_m(X_start, path.X_WT_end),
                             min_reach_m, kPathMargin * current().distance_m(path, X_end)});
    return path;
  }
  const CandidatePairs::Path expected = predicted_path(0.0, kImmediateTicks);
  const auto covers = [&](const Pose& X) { return current().distance_m(expected, X) <= expected.reach_m; };
  return within_prefetch_limits(expected) && covers(X_start) && covers(X_end) ? expected : path;
}

/// Precondition: the list covers the start. A list that covers both ends of a path covers the whole path.
double PredictiveCandidateList::covered_fraction_of(const CandidatePairs& list, const Pose& X_start,
                                                    const Pose& X_end) const noexcept {
  constexpr int kHalvings = 7;
  if (!list.will_cover(X_start)) return 0.0;
  if (list.will_cover(X_end)) return 1.0;
  double fraction = 0.0, beyond = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (fraction + beyond);
    const Pose X = {X_start.rotation.slerp(middle, X_end.rotation),
                    X_start.translation_m + middle * (X_end.translation_m - X_start.translation_m)};
    (list.will_cover(X) ? fraction : beyond) = middle;
  }
  return fraction;
}

void PredictiveCandidateList::prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s,
                                       std::uint32_t spare_visits) noexcept {
  sides_.set_admissible(X_WT, time_s);
  if (std::exchange(deferred_tick_, false))
    predictor_.observe_deferred(X_WP);
  else
    predictor_.observe(X_WT, X_WP);
  tick_duration_s_ = time_s - last_scene_time_s_;
  last_scene_time_s_ = time_s;
  const double service = service_ticks();
  const Pose X_service = predictor_.predict(service);
  const double service_time_s = time_s + service * tick_duration_s_;
  reach_scale_ = mispredicted_ ? std::min(kReachGrowth * reach_scale_, kMaxReachScale)
                               : std::max(kReachDecay * reach_scale_, 1.0);
  const bool wrong = std::exchange(mispredicted_, false) && !next_->will_cover(X_service, service_time_s);
  if (!next_->in_progress() || wrong) {
    if (next_list_unneeded(X_WT, service, time_s, spare_visits > 0)) return;
    const CandidatePairs::Path path =
        predicted_path(valid_for_ticks(kPathBegin * service, time_s), kPathEnd * service);
    if (!within_prefetch_limits(path)) return;
    if (next_->covers(X_WT, time_s)) make_current(next_);  // the next list covers more than the current one
    next_->start(path);
  }
  const std::uint32_t visits = std::max(visits_this_tick(X_service, service), spare_visits);
  if (continue_list(*next_, budget.reserved > 0 ? std::min(visits, allowed_visits(budget)) : visits, budget))
    adapt_horizon();
  if (horizon_ticks_ > kMinHorizon_ticks &&
      static_cast<double>(next_->pairs().size()) >
          kMaxGrowth * static_cast<double>(current().pairs().size()) + kSmallList_pairs) {
    horizon_ticks_ = std::max(kHorizonCut * horizon_ticks_, kMinHorizon_ticks);
    next_->clear();
  }
}

/// Returns the number of ticks, at most max_ticks, for which the current list covers the predicted path.
double PredictiveCandidateList::valid_for_ticks(double max_ticks, double time_s) const noexcept {
  double ticks = 0.0;
  while (ticks < max_ticks &&
         current_->covers(predictor_.predict(ticks + 1.0), time_s + (ticks + 1.0) * tick_duration_s_))
    ++ticks;
  return std::min(ticks, max_ticks);
}

/// Returns true if no new list is needed now. With spare work the next list starts as soon as the previous
/// one is complete, because a younger list uses a better prediction.
bool PredictiveCandidateList::next_list_unneeded(const Pose& X_WT, double service, double time_s,
                                                 bool has_spare_work) const noexcept {
  const auto covers = [&](const CandidatePairs& list, double ticks) {
    return list.covers(predictor_.predict(ticks), time_s + ticks * tick_duration_s_);
  };
  if (!has_spare_work) return covers(*current_, service) || covers(*next_, service);
  return covers(*current_, kPathEnd * service) || (covers(*next_, service) && !next_->covers(X_WT, time_s));
}

/// Returns the work on the next list in this tick [node visits], so that the list is complete when the
/// current one expires.
std::uint32_t PredictiveCandidateList::visits_this_tick(const Pose& X_service,
                                                        double service) const noexcept {
  double ticks_left = service;
  if (!scene_.has_moving_obstacles()) {
    const double tick_m = current().displacement_bound_m(predictor_.predict(0.0), X_service) / service;
    const double beyond_m = std::max(-current().margin_m(X_service), 0.0);
    ticks_left = std::max(1.0, tick_m > 0.0 ? service - beyond_m / tick_m : service);
  }
  return static_cast<std::uint32_t>(
      std::max(kBuildMargin * remaining_visits() / ticks_left, kMinWork_visits));
}

void PredictiveCandidateList::reset() noexcept {
  predictor_.reset();
  sides_.forget();
  for (CandidatePairs& list : lists_) list.clear();
  mispredicted_ = list_pending_ = deferred_tick_ = false;
  prefetch_cost_visits_ = immediate_cost_visits_ = 0;
  horizon_ticks_ = kMaxHorizon_ticks;
  reach_scale_ = 1.0;
}

/// Adapts the number of ticks that the next list shall serve to the costs of construction and culling.
void PredictiveCandidateList::adapt_horizon() noexcept {
  prefetch_cost_visits_ = next_->node_visits();
  const double cull_cost = kCullsPerTick * static_cast<double>(next_->pairs().size()) / kPairsPerVisit;
  const double build_cost = prefetch_cost_visits_ / horizon_ticks_;
  if (!next_->complete() || cull_cost > kCostRatio * build_cost)
    horizon_ticks_ = std::max(kHorizonFactor * horizon_ticks_, kMinHorizon_ticks);
  else if (build_cost > kCostRatio * cull_cost)
    horizon_ticks_ = std::min(horizon_ticks_ / kHorizonFactor, kMaxHorizon_ticks);
}

void PredictiveCandidateList::make_current(CandidatePairs*& list) noexcept {
  std::swap(current_, list);
}

double PredictiveCandidateList::service_ticks() const noexcept {
  const double horizon_m =
      current().displacement_bound_m(predictor_.predict(0.0), predictor_.predict(horizon_ticks_));
  const double max_m = kMaxPrefetchPath * scene_.tool_radius_m() / (kPathEnd - kPathBegin);
  return std::max(1.0, horizon_m > max_m ? horizon_ticks_ * max_m / horizon_m : horizon_ticks_);
}

CandidatePairs::Path PredictiveCandidateList::predicted_path(double from_ticks,
                                                             double to_ticks) const noexcept {
  const double r_m = scene_.tool_radius_m(), ticks = to_ticks - from_ticks;
  const Pose X_near = predictor_.predict(from_ticks), X_far = predictor_.predict(to_ticks);
  // The prediction may be wrong from the present pose on.
  const double path_m = current().displacement_bound_m(predictor_.predict(0.0), X_far);
  const bool expensive = prefetch_cost_visits_ > kExpensive_visits;
  const double shrink = expensive ? std::sqrt(kExpensive_visits / prefetch_cost_visits_) : 1.0;
  double reach_m = std::max(shrink * kPrefetchReach, kMinPrefetchReach) * path_m +
                   predictor_.chord_deviation_m(ticks, r_m);
  if (!expensive) reach_m = std::max(reach_m, std::min(reach_scale_ * reach_m, kMaxPrefetchReach * r_m));
  reach_m = std::max(reach_m, reach_scale_ * kMinReach * r_m);
  return {X_near, X_far, reach_m, last_scene_time_s_ + from_ticks * tick_duration_s_,
          last_scene_time_s_ + to_ticks * tick_duration_s_};
}

bool PredictiveCandidateList::within_prefetch_limits(const CandidatePairs::Path& path) const noexcept {
  const double r_m = scene_.tool_radius_m();
  return current().displacement_bound_m(path.X_WT_start, path.X_WT_end) <= kMaxPrefetchPath * r_m &&
         path.reach_m <= kMaxPrefetchReach * r_m;
}

}  // namespace wrenchd
