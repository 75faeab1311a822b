// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/query_cost.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <random>
#include <vector>

#include "collision/proxy.hpp"

namespace wrenchd {
namespace {

constexpr double kTick_s = 1e-3;
constexpr double kSpeed_m_per_s = 0.1, kTurn_rad_per_s = 2.0;
/// Largest distance of the hand from the proxy: that of a hand that yields to the force.
constexpr double kReach_m = 0.004, kReach_rad = 0.1;
constexpr double kDepth_m = 0.002;
/// Ticks of sliding in each place, and number of places.
constexpr int kSlideTicks = 200;
constexpr int kPlaces = 24;
/// Faces are drawn in proportion to their size: the largest of this number of random ones.
constexpr int kDraws = 16;

/// Processor time of this thread [s].
double thread_time_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Face {
  Vector3d p_m, normal;
};

Face random_face(const MeshSurface& surface, std::mt19937_64& random) {
  Face best = {Vector3d::Zero(), Vector3d::UnitZ()};
  double largest = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const auto t = static_cast<std::uint32_t>(random() % surface.triangles().size());
    const Vector3d &a = surface.corner_m(t, 0), &b = surface.corner_m(t, 1), &c = surface.corner_m(t, 2);
    const Vector3d area = (b - a).cross(c - a);
    if (!(area.norm() > largest)) continue;
    largest = area.norm();
    best = {(a + b + c) / 3.0, area.normalized()};
  }
  return best;
}

/// Returns X moved towards a target by at most these distances.
Pose moved_towards(const Pose& X, const Pose& target, double most_m, double most_rad) {
  const Vector3d path_m = target.translation_m - X.translation_m;
  const double angle = X.rotation.angularDistance(target.rotation), length_m = path_m.norm();
  return {X.rotation.slerp(angle > most_rad ? most_rad / angle : 1.0, target.rotation).normalized(),
          X.translation_m + path_m * (length_m > most_m ? most_m / length_m : 1.0)};
}

class CostEstimate {
 public:
  CostEstimate(const Scene& scene, double seconds)
      : scene_(scene), proxy_(scene), end_s_(thread_time_s() + seconds) {}

  void press(const MeshObstacle& obstacle) {
    const Face a = random_face(scene_.tool_mesh()->surface, random_);
    const Face b = random_face(obstacle.mesh->surface, random_);
    const Vector3d normal_W = obstacle.X_WO.rotation * b.normal, p_W_m = obstacle.X_WO * b.p_m;
    const Quaterniond rotation = Quaterniond::FromTwoVectors(a.normal, -normal_W);
    Pose X_target = {rotation, p_W_m - kDepth_m * normal_W - rotation * a.p_m};
    // The tool starts beyond the obstacle's bounding sphere and comes straight.
    const double away_m = 2.0 * (obstacle.radius_m + scene_.tool_radius_m());
    Pose X_WQ = {rotation, X_target.translation_m + away_m * normal_W};
    proxy_.clear_history();
    X_WQ = proxy_.follow(X_WQ, X_WQ).X_WQ;
    // The way there costs little and is not counted: big steps.
    for (int i = 0; i < 200 && thread_time_s() < end_s_; ++i)
      X_WQ = proxy_.follow(moved_towards(X_WQ, X_target, away_m / 100.0, kReach_rad), X_WQ).X_WQ;
    const Vector3d slide_W = normal_W.unitOrthogonal();
    Pose X_WP = X_WQ;
    for (int i = 0; i < kSlideTicks && thread_time_s() < end_s_; ++i) {
      X_target.translation_m += kTick_s * kSpeed_m_per_s * (i < kSlideTicks / 2 ? 0.5 : -0.5) * slide_W;
      X_target.rotation =
          X_target.rotation * rotation_from(kTick_s * 0.5 * kTurn_rad_per_s * Vector3d::UnitX());
      X_WP = moved_towards(X_WP, X_target, kTick_s * kSpeed_m_per_s, kTick_s * kTurn_rad_per_s);
      X_WP = moved_towards(X_WQ, X_WP, kReach_m, kReach_rad);
      const double begin_s = thread_time_s();
      X_WQ = proxy_.follow(X_WP, X_WQ).X_WQ;
      times_s_.push_back(thread_time_s() - begin_s);
      visits_.push_back(proxy_.node_visits());
    }
  }

  QueryCost result() {
    QueryCost cost;
    cost.ticks = times_s_.size();
    if (cost.ticks == 0) return cost;
    const std::size_t p99 = cost.ticks - 1 - cost.ticks / 100;
    std::sort(times_s_.begin(), times_s_.end());
    std::sort(visits_.begin(), visits_.end());
    cost.p99_visits = visits_[p99];
    cost.most_visits = visits_.back();
    cost.p99_s = times_s_[p99];
    cost.longest_s = times_s_.back();
    return cost;
  }

 private:
  const Scene& scene_;
  Proxy proxy_;
  double end_s_;
  std::mt19937_64 random_{1};
  std::vector<double> times_s_;
  std::vector<std::uint32_t> visits_;
};

}  // namespace

QueryCost estimate_query_cost(const Scene& scene, double seconds) {
  if (scene.meshes().empty() || scene.has_moving_obstacles()) return {};
  CostEstimate estimate(scene, seconds);
  for (int place = 0; place < kPlaces; ++place)
    estimate.press(scene.meshes()[static_cast<std::size_t>(place) % scene.meshes().size()]);
  return estimate.result();
}

std::string text(const QueryCost& cost) {
  const auto microseconds = [](double t_s) { return std::to_string(std::lround(1e6 * t_s)) + " us"; };
  return "99 % within " + microseconds(cost.p99_s) + " and " + std::to_string(cost.p99_visits) +
         " node visits, at most " + microseconds(cost.longest_s) + " and " +
         std::to_string(cost.most_visits) + " (pressed and slid for " + std::to_string(cost.ticks) +
         " ticks, on this machine)";
}

}  // namespace wrenchd
