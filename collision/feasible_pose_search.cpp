// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/feasible_pose_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace wrenchd {
namespace {

/// How far from p the search begins and ends, in units of the tool's size and of the scene's, and by what it
/// grows.
constexpr double kNearest = 1e-3;
constexpr double kGrowth = 1.3;
/// So many poses are looked at before the search grows.
constexpr int kTries = 40;
constexpr double kMostTurn_rad = 1.0;
/// So many poses found are tried.
constexpr int kMostStarts = 12;
/// Ticks that a proxy is given to come to rest, and the share of T that it must gain to go on.
constexpr int kMostTicks = 200;
constexpr double kGain = 1e-9;

/// Points spread evenly over the unit ball, the same in every run.
class Halton {
 public:
  Vector3d in_ball() noexcept {
    for (;;) {
      ++index_;
      Vector3d p = 2.0 * Vector3d(digit_sum(2), digit_sum(3), digit_sum(5)) - Vector3d::Ones();
      if (p.squaredNorm() <= 1.0) return p;
    }
  }

 private:
  /// The digits of the index to a base, behind the point and in reverse order.
  double digit_sum(int base) const noexcept {
    double sum = 0.0, weight = 1.0;
    for (int i = index_; i > 0; i /= base) sum += (weight /= base) * (i % base);
    return sum;
  }
  int index_ = 0;
};

/// How often a ray from p along x crosses the surface, odd: p is inside. A ray through an edge would count
/// twice or not at all, so it runs askew.
bool inside(const MeshSurface& surface, const Vector3d& p) noexcept {
  const Vector3d along(0.8626, 0.3919, 0.3199);
  bool odd = false;
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
    const Vector3d a = surface.corner_m(t, 0) - p, b = surface.corner_m(t, 1) - p,
                   c = surface.corner_m(t, 2) - p;
    const double u = along.dot(b.cross(c)), v = along.dot(c.cross(a)), w = along.dot(a.cross(b));
    const bool through = (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0);
    if (through && a.dot(b.cross(c)) / (u + v + w) > 0.0) odd = !odd;
  }
  return odd;
}

/// Nobody waits for one of its ticks.
Proxy::WorkLimit all_at_once() noexcept {
  Proxy::WorkLimit effort;
  effort.balanced = false;
  return effort;
}

}  // namespace

FeasiblePoseSearch::FeasiblePoseSearch(const Scene& scene)
    : scene_(scene), half_spaces_(scene), proxy_(scene, all_at_once()) {}

/// Two surfaces that do not meet are apart, or one body holds the other.
bool FeasiblePoseSearch::admissible(const Pose& X_WT, double time_s) noexcept {
  if (!half_spaces_.admits(Frame(X_WT), -Proxy::kClearance_m)) return false;
  for (const MeshObstacle& obstacle : scene_.meshes()) {
    const Pose X_WO = obstacle.X_WO_at(time_s);
    const double centres_m = (X_WO * obstacle.centre_O_m - X_WT.translation_m).norm();
    if (centres_m > obstacle.radius_m + scene_.tool_radius_m()) continue;
    const Pose X_OT = inverse(X_WO) * X_WT;
    if (!intersecting_pairs_.find(*scene_.tool_mesh(), *obstacle.mesh, X_OT))
      return false;  // far too much to be free
    if (!intersecting_pairs_.pairs().empty()) return false;
    const MeshSurface& tool = scene_.tool_mesh()->surface;
    const MeshSurface& solid = obstacle.mesh->surface;
    if (inside(tool, inverse(X_OT) * solid.corner_m(0, 0))) return false;
    if (solid.kind() == MeshSurface::Kind::solid && inside(solid, X_OT * tool.corner_m(0, 0))) return false;
  }
  return true;
}

/// From an admissible pose, as near to p as a proxy comes.
Projection FeasiblePoseSearch::converge_proxy(const Pose& X_WP, const Pose& X_start,
                                              const std::stop_token& stop, double time_s) noexcept {
  proxy_.clear_history(time_s);
  Projection q = proxy_.follow(X_WP, X_start, time_s);
  for (int tick = 1; tick < kMostTicks && !stop.stop_requested(); ++tick) {
    const Projection next = proxy_.follow(X_WP, q.X_WQ, time_s);
    const bool done = next.status != ProjectionStatus::budget_spent && next.energy > (1.0 - kGain) * q.energy;
    q = next;
    if (done) break;
  }
  return q;
}

Projection FeasiblePoseSearch::nearest(const Pose& X_WP, const std::stop_token& stop,
                                       double time_s) noexcept {
  if (admissible(X_WP, time_s)) return converge_proxy(X_WP, X_WP, stop, time_s);
  Projection best;
  best.X_WQ = X_WP;
  best.status = ProjectionStatus::infeasible;
  best.energy = std::numeric_limits<double>::infinity();
  double farthest_m = 4.0 * scene_.tool_radius_m();
  for (const MeshObstacle& obstacle : scene_.meshes())
    farthest_m += 2.0 * obstacle.mesh->surface.radius_m() +
                  (obstacle.X_WO_at(time_s).translation_m - X_WP.translation_m).norm();
  Halton points;
  int starts = 0;
  for (double r = kNearest * scene_.tool_radius_m(); r < farthest_m && starts < kMostStarts; r *= kGrowth)
    for (int i = 0; i < kTries && starts < kMostStarts && !stop.stop_requested(); ++i) {
      // Every other one turned, by as much as its points are moved.
      const Vector3d shift_m = r * points.in_ball();
      const Vector3d turn_rad = std::min(r / scene_.tool_radius_m(), kMostTurn_rad) * points.in_ball();
      const Quaterniond turn = i % 2 == 0 ? Quaterniond::Identity() : rotation_from(turn_rad);
      const Pose X_start = {(X_WP.rotation * turn).normalized(), X_WP.translation_m + shift_m};
      if (!admissible(X_start, time_s)) continue;
      ++starts;
      const Projection q = converge_proxy(X_WP, X_start, stop, time_s);
      if (q.energy < best.energy) best = q;
    }
  return best;
}

}  // namespace wrenchd
