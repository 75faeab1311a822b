// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/feasible_pose_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "collision/contact_detection.hpp"

namespace wrenchd {
namespace {

/// Radius of the first samples, in units of the tool's size, and growth of the radius.
constexpr double kFirstRadius = 1e-3;
constexpr double kGrowth = 1.3;
/// Number of samples at each radius.
constexpr int kSamplesPerRadius = 40;
constexpr double kMaxRotation_rad = 1.0;
/// Maximum number of admissible samples from which a proxy starts.
constexpr int kMaxStarts = 12;
/// Maximum number of proxy ticks, and the minimum relative decrease of T per tick.
constexpr int kMaxTicks = 200;
constexpr double kMinDecrease = 1e-9;

/// Halton sequence in the unit ball: evenly spread, equal in every run.
class Halton {
 public:
  Vector3d in_ball() noexcept {
    for (;;) {
      ++index_;
      Vector3d p =
          2.0 * Vector3d(radical_inverse(2), radical_inverse(3), radical_inverse(5)) - Vector3d::Ones();
      if (p.squaredNorm() <= 1.0) return p;
    }
  }

 private:
  /// Returns the digits of the index to a base in reverse order, as a fraction.
  double radical_inverse(int base) const noexcept {
    double sum = 0.0, weight = 1.0;
    for (int i = index_; i > 0; i /= base) sum += (weight /= base) * (i % base);
    return sum;
  }
  int index_ = 0;
};

/// The search is not bound to ticks, so its proxy needs no balanced work.
Proxy::WorkLimit unbalanced() noexcept {
  Proxy::WorkLimit effort;
  effort.balanced = false;
  return effort;
}

}  // namespace

FeasiblePoseSearch::FeasiblePoseSearch(const Scene& scene, ContactBackend contacts)
    : scene_(scene),
      half_spaces_(scene),
      overlap_test_(make_overlap_test(scene, contacts)),
      proxy_(scene, unbalanced(), contacts) {}

bool FeasiblePoseSearch::admissible(const Pose& X_WT, double time_s) noexcept {
  if (!half_spaces_.admits(Frame(X_WT), -Proxy::kClearance_m)) return false;
  for (const MeshObstacle& obstacle : scene_.meshes()) {
    const Pose X_WO = obstacle.X_WO_at(time_s);
    const double centres_m = (X_WO * obstacle.centre_O_m - X_WT.translation_m).norm();
    if (centres_m > obstacle.radius_m + scene_.tool_radius_m()) continue;
    if (overlap_test_->overlaps(obstacle, inverse(X_WO) * X_WT)) return false;
  }
  return true;
}

/// Lets a proxy approach p from an admissible pose until T stops decreasing.
Projection FeasiblePoseSearch::converge_proxy(const Pose& X_WP, const Pose& X_start,
                                              const std::stop_token& stop, double time_s) noexcept {
  proxy_.clear_history(time_s);
  Projection q = proxy_.follow(X_WP, X_start, time_s);
  for (int tick = 1; tick < kMaxTicks && !stop.stop_requested(); ++tick) {
    const Projection next = proxy_.follow(X_WP, q.X_WQ, time_s);
    const bool done =
        next.status != ProjectionStatus::budget_spent && next.energy > (1.0 - kMinDecrease) * q.energy;
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
  double max_radius_m = 4.0 * scene_.tool_radius_m();
  for (const MeshObstacle& obstacle : scene_.meshes())
    max_radius_m += 2.0 * obstacle.mesh->surface.radius_m() +
                    (obstacle.X_WO_at(time_s).translation_m - X_WP.translation_m).norm();
  Halton points;
  int starts = 0;
  for (double r = kFirstRadius * scene_.tool_radius_m(); r < max_radius_m && starts < kMaxStarts;
       r *= kGrowth)
    for (int i = 0; i < kSamplesPerRadius && starts < kMaxStarts && !stop.stop_requested(); ++i) {
      // Every second sample is rotated, by about the angle that moves its points as far as the translation
      // does.
      const Vector3d translation_m = r * points.in_ball();
      const Vector3d rotation_rad = std::min(r / scene_.tool_radius_m(), kMaxRotation_rad) * points.in_ball();
      const Quaterniond rotation = i % 2 == 0 ? Quaterniond::Identity() : rotation_from(rotation_rad);
      const Pose X_start = {(X_WP.rotation * rotation).normalized(), X_WP.translation_m + translation_m};
      if (!admissible(X_start, time_s)) continue;
      ++starts;
      const Projection q = converge_proxy(X_WP, X_start, stop, time_s);
      if (q.energy < best.energy) best = q;
    }
  return best;
}

}  // namespace wrenchd
