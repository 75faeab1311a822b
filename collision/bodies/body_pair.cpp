// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_pair.hpp"

#include <algorithm>
#include <utility>

namespace wrenchd {

double displacement_bound_m(const BodyPath& path, double radius_m) noexcept {
  return (path.end.translation_m - path.start.translation_m).norm() +
         radius_m * path.start.rotation.angularDistance(path.end.rotation);
}

BodyPair::BodyPair(std::size_t a, std::size_t b, Scene scene)
    : a_(a), b_(b), scene_(std::move(scene)), half_spaces_(scene_), contacts_(scene_, false) {}

Pose BodyPair::in_b(const Pose& X_WA, const Pose& X_WB) const noexcept {
  return is_fixed() ? X_WA : inverse(X_WB) * X_WA;
}

bool BodyPair::is_near(const BodyPath& path_a, const BodyPath& path_b) const noexcept {
  if (scene_.meshes().empty()) return false;
  if (scene_.has_moving_obstacles()) return true;
  const double reach_m = scene_.tool_radius_m() + displacement_bound_m(path_a, scene_.tool_radius_m());
  const auto touches_sphere = [&](const Vector3d& centre_W_m, double radius_m) {
    return (centre_W_m - path_a.start.translation_m).norm() <= reach_m + radius_m;
  };
  if (!is_fixed()) {
    const MeshObstacle& other = scene_.meshes().front();
    return touches_sphere(
        path_b.start * other.centre_O_m,
        other.radius_m + displacement_bound_m(path_b, other.radius_m + other.centre_O_m.norm()));
  }
  return std::any_of(scene_.meshes().begin(), scene_.meshes().end(), [&](const MeshObstacle& obstacle) {
    return touches_sphere(obstacle.centre_W_m, obstacle.radius_m);
  });
}

SweepQuery::SweepResult BodyPair::sweep(const BodyPath& path_a, const BodyPath& path_b, double clearance_m,
                                        VisitBudget& budget, const SweepTimes& times) noexcept {
  contacts_.set_start(in_b(path_a.start, path_b.start), times.start_s);
  return contacts_.sweep(in_b(path_a.end, path_b.end), clearance_m, budget, times.end_s);
}

void BodyPair::add_half_spaces(const Pose& X_WA, double clearance_m, ContactSet& contacts) const noexcept {
  half_spaces_.add_violated(Frame(X_WA), -clearance_m, contacts);
}

bool BodyPair::touches(const Contact& contact) const noexcept {
  return contact.obstacle < scene_.first_mesh() || contacts_.touching().contains(contact);
}

void BodyPair::prefetch(const BodyPath& path_a, const BodyPath& path_b, double time_s,
                        VisitBudget& budget) noexcept {
  contacts_.prefetch(in_b(path_a.start, path_b.start), in_b(path_a.end, path_b.end), budget, time_s);
}

}  // namespace wrenchd
