// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs_ahead.hpp"

#include <algorithm>
#include <utility>

namespace wrenchd {
namespace {

/// No list holds for less than this beside its way, in units of the tool's size.
constexpr double kLeastReach = 1e-4;
/// What a list made at once holds for beside its way, as a share of it.
constexpr double kReach = 0.08;
/// The same for a list made ahead, beside the way expected.
constexpr double kReachAhead = 0.04;
/// The longest way that a list is made for ahead, in units of the tool's size: a hand that is faster is
/// followed at once.
constexpr double kFarthestAhead = 0.2;
/// A list is made for so many ticks to come, at most and at least.
constexpr double kMostTicksAhead = 10.0;
constexpr double kLeastTicksAhead = 3.0;
/// It is begun when the one that serves ends within this share of them, and made in half the time.
constexpr double kSoon = 0.8;
constexpr double kHaste = 2.0;
/// A long list is dear to look at, a short one often to be made: where one costs so many times the other, the
/// next is made for fewer ticks or for more.
constexpr double kTooDear = 1.5;
constexpr double kFewer = 0.7;
/// The least that is done with a tick, in visits.
constexpr std::uint32_t kLeastPortion = 32;
/// No list made at once takes more than this share of the budget that is left: a way that is too long for it
/// may be followed by a shorter one.
constexpr double kLongestWalk = 0.7;
/// How much of the motion of the last tick counts, of which the motion to come is guessed.
constexpr double kNewest = 0.3;
constexpr double kNewestBend = 0.1;

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
  if (listed_->covers(X_end, times.end_s) && listed_->covers(X_start, times.start_s)) return true;
  spare_->set_out(way_to_list(X_start, X_end, times));
  go_on(*spare_, static_cast<std::uint32_t>(kLongestWalk * budget.visits), budget);
  if (!spare_->complete()) return false;
  ++made_at_once_;
  serve(spare_);
  return true;
}

/// For as long as it takes to make the next list, if the way leads where the tool is expected; else for this
/// way alone. Whether the way expected holds this one for obstacles that move too is not looked at.
NearPairs::Way PairsAhead::way_to_list(const Pose& X_start, const Pose& X_end,
                                       const Times& times) const noexcept {
  if (!scene_.moves()) {
    const NearPairs::Way way = way_ahead(X_start, ticks_ahead_ / kHaste + 2.0);
    if (goes_slowly(way) && listed_->away_m(way, X_end) <= way.reach_m) return way;
  }
  const double reach_m =
      std::max(kReach * listed_->way_m(X_start, X_end), kLeastReach * scene_.tool_radius_m());
  return {X_start, X_end, reach_m, times.start_s, times.end_s};
}

void PairsAhead::look_ahead(const Pose& X_WT, WalkBudget& budget, double time_s) noexcept {
  learn_motion(X_WT, time_s);
  if (!ahead_->under_way() && !set_out(X_WT)) return;
  const auto portion = static_cast<std::uint32_t>(kHaste * visits_of_list_ / ticks_ahead_);
  if (!go_on(*ahead_, std::max(kLeastPortion, portion), budget) || !ahead_->complete()) return;
  weigh();
  if (ahead_->covers(X_WT, time_s)) serve(ahead_);
}

void PairsAhead::forget_motion() noexcept {
  X_last_.reset();
  shift_m_ = turn_ = bend_m_ = bend_rad_ = Vector3d::Zero();
}

/// False where the list that serves will do for a while, or the tool is too fast.
bool PairsAhead::set_out(const Pose& X_WT) noexcept {
  const double soon = kSoon * ticks_ahead_;
  if (listed_->covers(X_WT, last_s_) && listed_->covers(after(soon, X_WT), last_s_ + soon * tick_s_))
    return false;
  const NearPairs::Way way = way_ahead(X_WT, ticks_ahead_);
  if (!goes_slowly(way)) return false;
  ahead_->set_out(way);
  return true;
}

/// How long the next list is to be, by what this one took to make and takes to look at.
void PairsAhead::weigh() noexcept {
  visits_of_list_ = ahead_->visits();
  const double looking = static_cast<double>(ahead_->pairs().size()) / kPairsPerVisit;
  const double making = kHaste * visits_of_list_ / ticks_ahead_;
  if (looking > kTooDear * making) ticks_ahead_ = std::max(kFewer * ticks_ahead_, kLeastTicksAhead);
  if (making > kTooDear * looking) ticks_ahead_ = std::min(ticks_ahead_ / kFewer, kMostTicksAhead);
}

void PairsAhead::serve(NearPairs*& list) noexcept {
  std::swap(listed_, list);
  visits_of_list_ = listed_->visits();
  ++edition_;
}

/// The motion from tick to tick and its change, smoothed.
void PairsAhead::learn_motion(const Pose& X_WT, double time_s) noexcept {
  tick_s_ = X_last_ ? time_s - last_s_ : 0.0;
  last_s_ = time_s;
  if (X_last_) {
    const Quaterniond turn = X_last_->rotation.conjugate() * X_WT.rotation;
    const Vector3d shift_more_m = kNewest * (X_WT.translation_m - X_last_->translation_m - shift_m_);
    const Vector3d turn_more = kNewest * ((turn.w() < 0.0 ? -2.0 : 2.0) * turn.vec() - turn_);
    shift_m_ += shift_more_m;
    turn_ += turn_more;
    bend_m_ += kNewestBend * (shift_more_m - bend_m_);
    bend_rad_ += kNewestBend * (turn_more - bend_rad_);
  }
  X_last_ = X_WT;
}

/// Where the tool will be if it moves on like this.
Pose PairsAhead::after(double ticks, const Pose& X_WT) const noexcept {
  const double late = (1.0 - kNewest) / kNewest;  // ticks by which what is smoothed lags
  const double bends = ticks * (0.5 * ticks + late);
  return {(X_WT.rotation * rotation_from(ticks * turn_ + bends * bend_rad_)).normalized(),
          X_WT.translation_m + ticks * shift_m_ + bends * bend_m_};
}

NearPairs::Way PairsAhead::way_ahead(const Pose& X_WT, double ticks) const noexcept {
  const double r_m = scene_.tool_radius_m();
  const Pose X_far = after(ticks, X_WT);
  // A parabola leaves its chord by an eighth of a t^2.
  const double bend_m = ticks * ticks / 8.0 * (bend_m_.norm() + r_m * bend_rad_.norm());
  const double reach_m = std::max(kReachAhead * listed_->way_m(X_WT, X_far) + bend_m, kLeastReach * r_m);
  return {X_WT, X_far, reach_m, last_s_, last_s_ + ticks * tick_s_};
}

bool PairsAhead::goes_slowly(const NearPairs::Way& way) const noexcept {
  return listed_->way_m(way.X_WT_start, way.X_WT_end) <= kFarthestAhead * scene_.tool_radius_m();
}

}  // namespace wrenchd
