// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/candidate_pairs.hpp"

#include <algorithm>

namespace wrenchd {

CandidatePairs::CandidatePairs(const Scene& scene, SurfaceSides* sides)
    : scene_(scene),
      sides_(sides),
      culler_(BvhTraversal::kCapacity, scene.meshes().size(), scene.tool_radius_m()) {
  pairs_.reserve(BvhTraversal::kCapacity);
  nearby_obstacles_.reserve(scene.meshes().size());
  relative_paths_.reserve(scene.meshes().size());
}

void CandidatePairs::start(const Path& path) noexcept {
  path_ = path;
  node_visits_ = 0;
  pairs_.clear();
  culler_.clear();
  find_nearby_static_obstacles();
  find_nearby_moving_obstacles();
  next_obstacle_ = 0;
  state_ = nearby_obstacles_.empty() ? State::complete : State::in_progress;
  start_next_obstacle();
}

void CandidatePairs::clear() noexcept {
  state_ = State::empty;
  node_visits_ = 0;
  pairs_.clear();
  culler_.clear();
}

void CandidatePairs::start_next_obstacle() noexcept {
  appended_ = 0;
  if (next_obstacle_ == nearby_obstacles_.size()) return;
  const std::uint32_t number = nearby_obstacles_[next_obstacle_];
  const MeshObstacle& obstacle = scene_.meshes()[number];
  const Pose X_OW_start = inverse(obstacle.X_WO_at(path_.start_s));
  const Pose X_OW_end = inverse(obstacle.X_WO_at(path_.end_s));
  traversal_.start(scene_.tool_mesh()->bvh, obstacle.mesh->bvh,
                   {X_OW_start * path_.X_WT_start, X_OW_end * path_.X_WT_end, path_.reach_m, false, false,
                    sides_ != nullptr ? sides_->of(number) : MeshSurface::kBothSides});
}

bool CandidatePairs::will_cover(const Pose& X_WT, double time_s) const noexcept {
  if (state_ == State::empty || margin_m(X_WT) < 0.0) return false;
  if (!scene_.has_moving_obstacles()) return true;
  return path_.start_s <= time_s && time_s <= path_.end_s &&
         std::all_of(relative_paths_.begin(), relative_paths_.end(), [&](const RelativePath& relative) {
           const Pose X_OW = inverse(scene_.meshes()[relative.obstacle].X_WO_at(time_s));
           return distance_m(relative.path, X_OW * X_WT) <= path_.reach_m;
         });
}

bool CandidatePairs::resume(VisitBudget& budget) noexcept {
  const std::uint32_t initial_budget = budget.remaining;
  bool ended = true;
  while (in_progress() && ended) {
    ended = traversal_.resume(budget);
    if (!append_found_pairs()) {
      state_ = State::failed;
    } else if (ended) {
      if (++next_obstacle_ == nearby_obstacles_.size()) state_ = State::complete;
      start_next_obstacle();
    }
  }
  node_visits_ += initial_budget - budget.remaining;
  return !in_progress();
}

/// Appends the pairs that the traversal has found since the last call. Returns false if there is no room.
bool CandidatePairs::append_found_pairs() noexcept {
  const std::size_t count = traversal_.size() - appended_;
  if (!traversal_.complete() || pairs_.size() + count > pairs_.capacity()) return false;
  const std::uint32_t obstacle = nearby_obstacles_[next_obstacle_];
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = scene_.meshes()[obstacle].mesh->surface;
  for (const TrianglePair& pair : std::span(traversal_.begin() + appended_, count)) {
    pairs_.push_back({pair.a, pair.b, obstacle});
    culler_.add(tool, pair.a, surface, pair.b, obstacle);
  }
  appended_ = traversal_.size();
  return true;
}

/// Finds the nearest pose of the path by projecting translation and rotation together on the path.
double CandidatePairs::distance_m(const Path& path, const Pose& X_WT) const noexcept {
  const Pose& start = path.X_WT_start;
  const Pose& end = path.X_WT_end;
  const double r_m = scene_.tool_radius_m();
  const Vector3d translation_m = end.translation_m - start.translation_m;
  const Vector3d rotation = small_rotation_vector(start.rotation.conjugate() * end.rotation);
  const double length2 = translation_m.squaredNorm() + r_m * r_m * rotation.squaredNorm();
  const double projection =
      translation_m.dot(X_WT.translation_m - start.translation_m) +
      r_m * r_m * rotation.dot(small_rotation_vector(start.rotation.conjugate() * X_WT.rotation));
  const double fraction = length2 > 0.0 ? std::clamp(projection / length2, 0.0, 1.0) : 0.0;
  return displacement_bound_m(
      X_WT, {start.rotation.slerp(fraction, end.rotation), start.translation_m + fraction * translation_m});
}

double CandidatePairs::displacement_bound_m(const Pose& from, const Pose& to) const noexcept {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Selects the obstacles at rest that are near. Few of thousands are near, and the selection stays valid
/// while the tool moves by its own size.
void CandidatePairs::find_nearby_static_obstacles() noexcept {
  const auto from_centre_m = [&](const Pose& X) { return (X.translation_m - nearby_centre_W_m_).norm(); };
  nearby_obstacles_.resize(nearby_static_count_);
  if (std::max(from_centre_m(path_.X_WT_start), from_centre_m(path_.X_WT_end)) + path_.reach_m <=
      nearby_radius_m_)
    return;
  const double tool_m = scene_.tool_radius_m();
  nearby_centre_W_m_ = path_.X_WT_start.translation_m;
  nearby_radius_m_ = tool_m + path_.reach_m + from_centre_m(path_.X_WT_end);
  nearby_obstacles_.clear();
  for (std::uint32_t k = 0; k < scene_.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene_.meshes()[k];
    if (obstacle.moves()) continue;
    const double contact_distance_m = obstacle.radius_m + tool_m + nearby_radius_m_;
    if ((obstacle.centre_W_m - nearby_centre_W_m_).squaredNorm() <= contact_distance_m * contact_distance_m)
      nearby_obstacles_.push_back(k);
  }
  nearby_static_count_ = nearby_obstacles_.size();
}

/// Selects the moving obstacles that the tool may meet on the path. They are few.
void CandidatePairs::find_nearby_moving_obstacles() noexcept {
  relative_paths_.clear();
  if (!scene_.has_moving_obstacles()) return;
  const double tool_m = scene_.tool_radius_m() + path_.reach_m +
                        (path_.X_WT_end.translation_m - path_.X_WT_start.translation_m).norm();
  for (std::uint32_t k = 0; k < scene_.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene_.meshes()[k];
    if (!obstacle.moves()) continue;
    const Pose X_WO = obstacle.X_WO_at(path_.start_s);
    const double moved_m = (path_.end_s - path_.start_s) * obstacle.speed_bound_m_per_s();
    const double contact_distance_m = obstacle.radius_m + tool_m + moved_m;
    if ((X_WO * obstacle.centre_O_m - path_.X_WT_start.translation_m).squaredNorm() >
        contact_distance_m * contact_distance_m)
      continue;
    nearby_obstacles_.push_back(k);
    relative_paths_.push_back({k,
                               {inverse(X_WO) * path_.X_WT_start,
                                inverse(obstacle.X_WO_at(path_.end_s)) * path_.X_WT_end, path_.reach_m}});
  }
}

}  // namespace wrenchd
