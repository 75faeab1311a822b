// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/bvh_traversal.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

simd::Transform single_transform(const Pose& X) noexcept {
  return simd::to_single(X.rotation.toRotationMatrix(), X.translation_m);
}

simd::Transform displacement_between(const Pose& from, const Pose& to) noexcept {
  return simd::to_single(to.rotation.toRotationMatrix() - from.rotation.toRotationMatrix(),
                         to.translation_m - from.translation_m);
}

/// Converts the motion to single precision. The boxes stand half way along the path and are enlarged to
/// contain both ends. A point at a distance r from A's origin deviates from the straight line between its
/// ends by at most angle^2 r / 8. The middle of that line deviates by the same amount from the point of the
/// pose half way.
simd::RelativeMotion motion_of(const Sweep& sweep, double least_radius_a_m, double extent_m) noexcept {
  const double radius_a_m = std::sqrt(3.0) * least_radius_a_m;
  const auto& [start, end, reach_m, all_pairs, classify, sides_b] = sweep;
  simd::RelativeMotion motion;
  const Pose middle = {start.rotation.slerp(0.5, end.rotation),
                       0.5 * (start.translation_m + end.translation_m)};
  motion.X_BA_middle = single_transform(middle);
  motion.X_AB_middle = single_transform(inverse(middle));
  motion.X_BA_start = single_transform(start);
  motion.X_BA_end = single_transform(end);
  motion.displacement_BA = displacement_between(start, end);
  motion.displacement_AB = displacement_between(inverse(start), inverse(end));
  const double angle = start.rotation.angularDistance(end.rotation);
  const double arc_deviation_m = 0.25 * angle * angle * radius_a_m;
  const double rounding_m =
      simd::kRounding * (extent_m + std::max(start.translation_m.lpNorm<Eigen::Infinity>(),
                                             end.translation_m.lpNorm<Eigen::Infinity>()));
  motion.all_pairs = all_pairs;
  motion.sides_b = sides_b;
  motion.half_angle = static_cast<float>(0.5 * angle);
  motion.margin = static_cast<float>(reach_m + arc_deviation_m + rounding_m);
  motion.reach = static_cast<float>(reach_m + arc_deviation_m);
  motion.radius = static_cast<float>(least_radius_a_m);
  motion.rounding = static_cast<float>(rounding_m);
  for (int d = 0; d < 3; ++d) motion.centre_B[d] = static_cast<float>(end.translation_m[d]);
  motion.centre_travel = static_cast<float>((end.translation_m - start.translation_m).norm());
  motion.moving =
      start.translation_m != end.translation_m || start.rotation.coeffs() != end.rotation.coeffs();
  motion.classify = classify && all_pairs && !motion.moving && reach_m == 0.0;
  return motion;
}

/// Returns the pose of A's data relative to B's data, for a pose of mesh A in the frame of mesh B.
Pose between_data(const TriangleBvh& a, const TriangleBvh& b, const Pose& X_BA) noexcept {
  return {b.R_SM() * X_BA.rotation * a.R_SM().conjugate(), b.R_SM() * X_BA.translation_m};
}

simd::BvhArrays arrays_of(const TriangleBvh& tree) noexcept {
  return {tree.boxes().data(), tree.nodes().data(), tree.leaves().data()};
}

}  // namespace

BvhTraversal::BvhTraversal(simd::TraversalKernel kernel)
    : kernel_(kernel != nullptr  ? kernel
              : simd::has_avx2() ? simd::traverse_avx2
                                 : simd::traverse_portable),
      job_(),
      pairs_(kCapacity),
      stack_(2 * simd::kStack),
      moved_leaves_(simd::kMovedLeavesBytes / sizeof(CacheLine)) {}

void BvhTraversal::start(const TriangleBvh& a, const TriangleBvh& b, const Sweep& sweep) noexcept {
  const Sweep of_data = {between_data(a, b, sweep.X_BA_start),
                         between_data(a, b, sweep.X_BA_end),
                         sweep.reach_m,
                         sweep.all_pairs,
                         sweep.classify,
                         sweep.sides_b};
  job_ = {arrays_of(a),
          arrays_of(b),
          motion_of(of_data, a.extent_m(), std::sqrt(3.0) * a.extent_m() + b.extent_m()),
          pairs_.data(),
          static_cast<std::uint32_t>(pairs_.size()),
          stack_.data(),
          moved_leaves_.data()};
  job_.started = a.nodes().empty() || b.nodes().empty();  // without nodes there is nothing to start with
}

bool BvhTraversal::resume(VisitBudget& budget) noexcept {
  job_.node_visits = 0;
  job_.max_node_visits = budget.remaining;
  kernel_(job_);
  budget.remaining -= std::min(budget.remaining, job_.node_visits);
  return job_.stack_top == 0 || job_.overflow;
}

}  // namespace wrenchd
