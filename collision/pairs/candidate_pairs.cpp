// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/candidate_pairs.hpp"

#include <algorithm>

namespace wrenchd {

NearPairs::NearPairs(const Scene& scene)
    : scene_(scene), sieve_(TreeWalk::kCapacity, scene.meshes().size(), scene.tool_radius_m()) {
  pairs_.reserve(TreeWalk::kCapacity);
  near_by_.reserve(scene.meshes().size());
  relative_.reserve(scene.meshes().size());
}

void NearPairs::set_out(const Way& way) noexcept {
  way_ = way;
  visits_ = 0;
  pairs_.clear();
  sieve_.clear();
  find_near_by();
  find_moving_near_by();
  next_ = 0;
  state_ = near_by_.empty() ? State::complete : State::under_way;
  set_out_for_next();
}

void NearPairs::clear() noexcept {
  state_ = State::empty;
  visits_ = 0;
  pairs_.clear();
  sieve_.clear();
}

void NearPairs::set_out_for_next() noexcept {
  taken_ = 0;
  if (next_ == near_by_.size()) return;
  const MeshObstacle& obstacle = scene_.meshes()[near_by_[next_]];
  const Pose X_OW_start = inverse(obstacle.X_WO_at(way_.start_s));
  const Pose X_OW_end = inverse(obstacle.X_WO_at(way_.end_s));
  walk_.set_out(scene_.tool_mesh()->tree, obstacle.mesh->tree,
                {X_OW_start * way_.X_WT_start, X_OW_end * way_.X_WT_end, way_.reach_m, false});
}

bool NearPairs::will_cover(const Pose& X_WT, double time_s) const noexcept {
  if (state_ == State::empty || room_m(X_WT) < 0.0) return false;
  if (!scene_.moves()) return true;
  return way_.start_s <= time_s && time_s <= way_.end_s &&
         std::all_of(relative_.begin(), relative_.end(), [&](const Relative& seen) {
           const Pose X_OW = inverse(scene_.meshes()[seen.obstacle].X_WO_at(time_s));
           return away_m(seen.way, X_OW * X_WT) <= way_.reach_m;
         });
}

bool NearPairs::go_on(WalkBudget& budget) noexcept {
  const std::uint32_t granted = budget.visits;
  bool ended = true;
  while (under_way() && ended) {
    ended = walk_.go_on(budget);
    if (!take_over()) {
      state_ = State::failed;
    } else if (ended) {
      if (++next_ == near_by_.size()) state_ = State::complete;
      set_out_for_next();
    }
  }
  visits_ += granted - budget.visits;
  return !under_way();
}

/// What the walk has found since. False where there is no room for it.
bool NearPairs::take_over() noexcept {
  const std::size_t found = walk_.size() - taken_;
  if (!walk_.complete() || pairs_.size() + found > pairs_.capacity()) return false;
  const std::uint32_t obstacle = near_by_[next_];
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = scene_.meshes()[obstacle].mesh->surface;
  for (const TrianglePair& pair : std::span(walk_.begin() + taken_, found)) {
    pairs_.push_back({pair.a, pair.b, obstacle});
    sieve_.add(tool, pair.a, surface, pair.b, obstacle);
  }
  taken_ = walk_.size();
  return true;
}

/// The nearest pose on the way is as far along it as the shift and the turn together say.
double NearPairs::away_m(const Way& way, const Pose& X_WT) const noexcept {
  const Pose& start = way.X_WT_start;
  const Pose& end = way.X_WT_end;
  const double r_m = scene_.tool_radius_m();
  const Vector3d shift_m = end.translation_m - start.translation_m;
  const Vector3d turn = small_rotation_vector(start.rotation.conjugate() * end.rotation);
  const double length2 = shift_m.squaredNorm() + r_m * r_m * turn.squaredNorm();
  const double along =
      shift_m.dot(X_WT.translation_m - start.translation_m) +
      r_m * r_m * turn.dot(small_rotation_vector(start.rotation.conjugate() * X_WT.rotation));
  const double share = length2 > 0.0 ? std::clamp(along / length2, 0.0, 1.0) : 0.0;
  return way_m(X_WT, {start.rotation.slerp(share, end.rotation), start.translation_m + share * shift_m});
}

double NearPairs::way_m(const Pose& from, const Pose& to) const noexcept {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Of thousands of obstacles few are near, and they stay the same while the tool moves by its own size.
void NearPairs::find_near_by() noexcept {
  const auto from_there_m = [&](const Pose& X) { return (X.translation_m - near_p_WT_m_).norm(); };
  near_by_.resize(near_at_rest_);
  if (std::max(from_there_m(way_.X_WT_start), from_there_m(way_.X_WT_end)) + way_.reach_m <= near_reach_m_)
    return;
  const double tool_m = scene_.tool_radius_m();
  near_p_WT_m_ = way_.X_WT_start.translation_m;
  near_reach_m_ = tool_m + way_.reach_m + from_there_m(way_.X_WT_end);
  near_by_.clear();
  for (std::uint32_t k = 0; k < scene_.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene_.meshes()[k];
    if (obstacle.moves()) continue;
    const double together_m = obstacle.radius_m + tool_m + near_reach_m_;
    if ((obstacle.centre_W_m - near_p_WT_m_).squaredNorm() <= together_m * together_m) near_by_.push_back(k);
  }
  near_at_rest_ = near_by_.size();
}

/// Of those that move, all that may be met on the way; they are few.
void NearPairs::find_moving_near_by() noexcept {
  relative_.clear();
  if (!scene_.moves()) return;
  const double tool_m = scene_.tool_radius_m() + way_.reach_m +
                        (way_.X_WT_end.translation_m - way_.X_WT_start.translation_m).norm();
  for (std::uint32_t k = 0; k < scene_.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene_.meshes()[k];
    if (!obstacle.moves()) continue;
    const Pose X_WO = obstacle.X_WO_at(way_.start_s);
    const double moved_m = (way_.end_s - way_.start_s) * obstacle.fastest_m_per_s();
    const double together_m = obstacle.radius_m + tool_m + moved_m;
    if ((X_WO * obstacle.centre_O_m - way_.X_WT_start.translation_m).squaredNorm() > together_m * together_m)
      continue;
    near_by_.push_back(k);
    relative_.push_back({k,
                         {inverse(X_WO) * way_.X_WT_start,
                          inverse(obstacle.X_WO_at(way_.end_s)) * way_.X_WT_end, way_.reach_m}});
  }
}

}  // namespace wrenchd
