// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/contact_seeking_hand.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd::test {
namespace {

constexpr double kTick_s = 1e-3;

/// Returns X moved towards a target by at most these distances.
Pose moved_towards(const Pose& X, const Pose& target, double most_m, double most_rad) {
  const Vector3d d = target.translation_m - X.translation_m;
  const double angle = X.rotation.angularDistance(target.rotation);
  return {X.rotation.slerp(angle > most_rad ? most_rad / angle : 1.0, target.rotation).normalized(),
          X.translation_m + d * (d.norm() > most_m ? most_m / d.norm() : 1.0)};
}

double radius_m(const TriangleMesh& mesh, const Vector3d& middle_m) {
  double radius = 0.0;
  for (const Vector3d& p : mesh.vertices_m) radius = std::max(radius, (p - middle_m).norm());
  return radius;
}

Vector3d middle_of(const TriangleMesh& mesh) {
  Vector3d low = mesh.vertices_m.front(), high = low;
  for (const Vector3d& p : mesh.vertices_m) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return 0.5 * (low + high);
}

}  // namespace

ContactSeekingHand::ContactSeekingHand(const TriangleMesh& tool, const TriangleMesh& obstacle,
                                       std::uint64_t seed, Limits limits)
    : tool_(tool),
      obstacle_(obstacle),
      random_(seed),
      limits_(limits),
      tool_middle_m_(middle_of(tool)),
      middle_m_(middle_of(obstacle)),
      away_m_(radius_m(tool, Vector3d::Zero()) + radius_m(obstacle, middle_m_) + 0.001),
      R_upright_(seed % 2 == 0 ? Quaterniond(0.0, 1.0, 0.0, 0.0) : Quaterniond::Identity()) {
  if (limits.approach == Approach::axis)
    X_WP_ = {R_upright_, middle_m_ - R_upright_ * tool_middle_m_ + away_m_ * Vector3d::UnitZ()};
  else
    X_WP_ = {random_.rotation(), middle_m_ + away_m_ * random_.unit<3>()};
}

/// Picks a triangle in proportion to the square root of its area at least: the largest of some random ones.
ContactSeekingHand::Face ContactSeekingHand::random_face(const TriangleMesh& mesh) {
  constexpr int kCandidates = 30;
  Face best{};
  double largest = -1.0;
  for (int i = 0; i < kCandidates; ++i) {
    const auto& t = mesh.triangles[random_.bits() % mesh.triangles.size()];
    const Vector3d &a = mesh.vertices_m[t[0]], &b = mesh.vertices_m[t[1]], &c = mesh.vertices_m[t[2]];
    const Vector3d n = (b - a).cross(c - a);
    if (n.norm() <= largest || n.norm() == 0.0) continue;
    largest = n.norm();
    best = {(a + b + c) / 3.0, n.normalized()};
  }
  return best;
}

/// Chooses two faces to press together, or sometimes a vertex and a random orientation.
void ContactSeekingHand::choose_target() {
  const double depth_m = random_.uniform(0.0005, 0.003);
  const Face a = random_face(tool_), b = random_face(obstacle_);
  Quaterniond R = Quaterniond::FromTwoVectors(X_WP_.rotation * a.n, -b.n) * X_WP_.rotation;
  if (random_.chance(0.25)) R = X_WP_.rotation * random_.rotation(0.3);
  X_target_ = {R.normalized(), b.p - depth_m * b.n - R * a.p};
  slide_m_per_s_ = 0.5 * limits_.speed_m_per_s * b.n.cross(random_.unit<3>());
  ticks_left_ = random_.integer(300, 1200);
}

/// Chooses a pose below the obstacle; the hand presses towards it. Sometimes the hand lifts the tool.
void ContactSeekingHand::choose_axial_target() {
  constexpr double kAside_m = 0.001, kTilt_rad = 0.04, kTurn_rad = 1.5;
  const Quaterniond R = rotation_from({0, 0, random_.uniform(-kTurn_rad, kTurn_rad)}) *
                        rotation_from(random_.uniform(0.0, kTilt_rad) *
                                      Vector3d(random_.normal(), random_.normal(), 0.0).normalized()) *
                        R_upright_;
  const Vector3d aside_m = random_.uniform(0.0, kAside_m) * random_.unit<3>();
  X_target_ = {R, middle_m_ + aside_m - R * tool_middle_m_ - away_m_ * Vector3d::UnitZ()};
  if (random_.chance(0.1)) X_target_.translation_m.z() = X_WP_.translation_m.z() + 0.003;
  ticks_left_ = random_.integer(100, 600);
}

const Pose& ContactSeekingHand::next(const Pose& X_WQ) {
  if (--ticks_left_ < 0) limits_.approach == Approach::axis ? choose_axial_target() : choose_target();
  const double step_m = limits_.speed_m_per_s * kTick_s, step_rad = limits_.turn_rad_per_s * kTick_s;
  X_target_.translation_m += kTick_s * slide_m_per_s_;
  const Pose wanted = moved_towards(X_WP_, X_target_, step_m, step_rad);
  // A hand that is held back stays near the proxy, but moves no faster than before.
  X_WP_ =
      moved_towards(X_WP_, moved_towards(X_WQ, wanted, limits_.reach_m, limits_.reach_rad), step_m, step_rad);
  return X_WP_;
}

}  // namespace wrenchd::test
