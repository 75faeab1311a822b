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
std::uint32_t most_visits(const WalkBudget& budget) noexcept {
  if (budget.kept > 0) return budget.visits - std::min(budget.visits, budget.kept);
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
  late_ = false;
  if (holds(*listed_)) return true;
  if (ahead_->under_way() && will_hold(*ahead_) && is_sooner_made(most_visits(budget))) {
    if (go_on(*ahead_, most_visits(budget), budget)) weigh();
    if (ahead_->under_way() && budget.kept > 0) return late();
  }
  if (holds(*ahead_)) {
    serve(ahead_);
    ahead_->clear();  // it has served
    return true;
  }
  if (!list_at_once(X_start, X_end, times, budget)) return false;
  ++made_at_once_;
  visits_at_once_ = spare_->visits();
  serve(spare_);
  const bool ahead_is_there = ahead_->under_way() || ahead_->complete();
  astray_ = astray_ || (ahead_is_there && !ahead_->will_cover(X_end, times.end_s));
  return holds(*listed_);  // one that was late was made for where the tool was to go then
}

/// Is what is left of the list ahead sooner made than another at once? Not where it would take more than so
/// many visits, and the other would not.
bool PairsAhead::is_sooner_made(std::uint32_t most) const noexcept {
  const double at_once = visits_at_once_ > 0 ? visits_at_once_ : kAtOnce * listed().visits();
  return to_do() <= most || at_once > most;
}

/// What the list ahead takes yet, in visits.
double PairsAhead::to_do() const noexcept {
  const double expected = std::max(visits_of_list_, listed().visits());
  return std::max(expected - ahead_->visits(), kUnforeseen * expected);
}

bool PairsAhead::late() noexcept {
  late_ = late_tick_ = true;
  return false;
}

/// One that was late already is gone on with, if it leads on.
bool PairsAhead::list_at_once(const Pose& X_start, const Pose& X_end, const Times& times,
                              WalkBudget& budget) noexcept {
  const std::uint32_t most = most_visits(budget);
  const bool waits = budget.kept > 0;
  if (waits && most < kLeastPortion) return late();
  const bool begun = waits && spare_->under_way() &&
                     share_of(*spare_, X_start, X_end) > share_of(*listed_, X_start, X_end) + kLeadsOn;
  if (!begun) {
    const double ticks =
        waits && listed().visits() > most ? static_cast<double>(listed().visits()) / most : 0.0;
    spare_->set_out(way_at_once(X_start, X_end, times, std::log2(1.0 + ticks)));
  }
  go_on(*spare_, most, budget);
  if (waits && spare_->under_way()) return late();
  return spare_->complete();
}

/// For as long as it takes to make the next list, if the way leads where the tool is expected; else for this
/// way alone. One that will be late is made for as much longer as the hand will have gone on by then. Whether
/// the way expected holds this one for obstacles that move too is not looked at.
NearPairs::Way PairsAhead::way_at_once(const Pose& X_start, const Pose& X_end, const Times& times,
                                       double wait_ticks) const noexcept {
  const double least_m = (motion_.known() ? kLeastReach : kFirstReach) * scene_.tool_radius_m();
  NearPairs::Way way = {X_start, X_end, std::max(kReach * listed().way_m(X_start, X_end), least_m),
                        times.start_s, times.end_s};
  if (scene_.moves() || !motion_.known()) return way;
  if (wait_ticks > 0.0) {
    const Pose X_now = motion_.after(0.0), X_then = motion_.after(wait_ticks + kTicksAtOnce);
    way.X_WT_end = {(X_then.rotation * X_now.rotation.conjugate() * X_end.rotation).normalized(),
                    X_end.translation_m + X_then.translation_m - X_now.translation_m};
    way.reach_m = std::max(
        {kReach * listed().way_m(X_start, way.X_WT_end), least_m, kBesideWay * listed().away_m(way, X_end)});
    return way;
  }
  const NearPairs::Way expected = way_ahead(0.0, kTicksAtOnce);
  const auto holds = [&](const Pose& X) { return listed().away_m(expected, X) <= expected.reach_m; };
  return goes_slowly(expected) && holds(X_start) && holds(X_end) ? expected : way;
}

/// The start must be among what the list holds for. A list holds for the whole of a way if for its ends.
double PairsAhead::share_of(const NearPairs& list, const Pose& X_start, const Pose& X_end) const noexcept {
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

void PairsAhead::look_ahead(const Pose& X_WT, const Pose& X_WP, WalkBudget& budget, double time_s,
                            std::uint32_t to_spare) noexcept {
  if (std::exchange(late_tick_, false))
    motion_.learn_late(X_WP);
  else
    motion_.learn(X_WT, X_WP);
  tick_s_ = time_s - last_s_;
  last_s_ = time_s;
  const double soon = ticks_to_serve();
  const Pose X_soon = motion_.after(soon);
  const double soon_s = time_s + soon * tick_s_;
  unsure_ = astray_ ? std::min(kLessSurely * unsure_, kLeastSurely) : std::max(kMoreSurely * unsure_, 1.0);
  const bool astray = std::exchange(astray_, false) && !ahead_->will_cover(X_soon, soon_s);
  if (!ahead_->under_way() || astray) {
    if (provided(X_WT, soon, time_s, to_spare > 0)) return;
    const NearPairs::Way way = way_ahead(holds_for_ticks(kFrom * soon, time_s), kTo * soon);
    if (!goes_slowly(way)) return;
    if (ahead_->covers(X_WT, time_s)) serve(ahead_);  // it holds for longer than the one that serves
    ahead_->set_out(way);
  }
  const std::uint32_t visits = std::max(portion(X_soon, soon), to_spare);
  if (go_on(*ahead_, budget.kept > 0 ? std::min(visits, most_visits(budget)) : visits, budget)) weigh();
  if (ticks_ahead_ > kLeastTicksAhead && static_cast<double>(ahead_->pairs().size()) >
                                             kFarMore * static_cast<double>(listed().pairs().size()) + kFew) {
    ticks_ahead_ = std::max(kFarFewer * ticks_ahead_, kLeastTicksAhead);
    ahead_->clear();
  }
}

/// For how many ticks yet the list that serves holds, if the tool goes where it is expected; so many at most.
double PairsAhead::holds_for_ticks(double most, double time_s) const noexcept {
  double ticks = 0.0;
  while (ticks < most && listed_->covers(motion_.after(ticks + 1.0), time_s + (ticks + 1.0) * tick_s_))
    ++ticks;
  return std::min(ticks, most);
}

/// Is there no list to be begun now? With work to spare the next is begun as soon as the last is made, if it
/// leads on: the younger a list, the better the motion was known.
bool PairsAhead::provided(const Pose& X_WT, double soon, double time_s, bool to_spare) const noexcept {
  const auto covers = [&](const NearPairs& list, double ticks) {
    return list.covers(motion_.after(ticks), time_s + ticks * tick_s_);
  };
  if (!to_spare) return covers(*listed_, soon) || covers(*ahead_, soon);
  return covers(*listed_, kTo * soon) || (covers(*ahead_, soon) && !ahead_->covers(X_WT, time_s));
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
  return static_cast<std::uint32_t>(std::max(kHaste * to_do() / left, kLeastPortion));
}

void PairsAhead::forget() noexcept {
  motion_.forget();
  for (NearPairs& list : lists_) list.clear();
  astray_ = late_ = late_tick_ = false;
  visits_of_list_ = visits_at_once_ = 0;
  ticks_ahead_ = kMostTicksAhead;
  unsure_ = 1.0;
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
  const bool dear = visits_of_list_ > kDear;
  const double less = dear ? std::sqrt(kDear / visits_of_list_) : 1.0;
  double reach_m = std::max(less * kReachAhead, kLeastReachAhead) * way_m + motion_.bend_m(ticks, r_m);
  if (!dear) reach_m = std::max(reach_m, std::min(unsure_ * reach_m, kWidestAhead * r_m));
  reach_m = std::max(reach_m, unsure_ * kLeastReach * r_m);
  return {X_near, X_far, reach_m, last_s_ + from_ticks * tick_s_, last_s_ + to_ticks * tick_s_};
}

bool PairsAhead::goes_slowly(const NearPairs::Way& way) const noexcept {
  const double r_m = scene_.tool_radius_m();
  return listed().way_m(way.X_WT_start, way.X_WT_end) <= kFarthestAhead * r_m &&
         way.reach_m <= kWidestAhead * r_m;
}

}  // namespace wrenchd
