// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/bvh_traversal.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

walk::Transform single(const Pose& X) noexcept {
  return walk::single(X.rotation.toRotationMatrix(), X.translation_m);
}

walk::Transform travel(const Pose& from, const Pose& to) noexcept {
  return walk::single(to.rotation.toRotationMatrix() - from.rotation.toRotationMatrix(),
                      to.translation_m - from.translation_m);
}

/// The motion in single precision. The boxes are moved half way and grown by what is missing to both ends; a
/// point at a distance r from A's origin leaves the straight line between its ends by no more than
/// angle^2 r / 8, and the line's middle lies as far from where the pose half way takes it.
walk::Motion motion_of(const Sweep& sweep, double least_radius_a_m, double extent_m) noexcept {
  const double radius_a_m = std::sqrt(3.0) * least_radius_a_m;
  const auto& [start, end, reach_m, all_pairs, settle] = sweep;
  walk::Motion motion;
  const Pose middle = {start.rotation.slerp(0.5, end.rotation),
                       0.5 * (start.translation_m + end.translation_m)};
  motion.X_BA_middle = single(middle);
  motion.X_AB_middle = single(inverse(middle));
  motion.X_BA_start = single(start);
  motion.X_BA_end = single(end);
  motion.travel_BA = travel(start, end);
  motion.travel_AB = travel(inverse(start), inverse(end));
  const double angle = start.rotation.angularDistance(end.rotation);
  const double bulge_m = 0.25 * angle * angle * radius_a_m;
  const double rounding_m =
      walk::kRounding * (extent_m + std::max(start.translation_m.lpNorm<Eigen::Infinity>(),
                                             end.translation_m.lpNorm<Eigen::Infinity>()));
  motion.all_pairs = all_pairs;
  motion.half_turn = static_cast<float>(0.5 * angle);
  motion.margin = static_cast<float>(reach_m + bulge_m + rounding_m);
  motion.reach = static_cast<float>(reach_m + bulge_m);
  motion.radius = static_cast<float>(least_radius_a_m);
  motion.rounding = static_cast<float>(rounding_m);
  for (int d = 0; d < 3; ++d) motion.centre_B[d] = static_cast<float>(end.translation_m[d]);
  motion.centre_way = static_cast<float>((end.translation_m - start.translation_m).norm());
  motion.moving =
      start.translation_m != end.translation_m || start.rotation.coeffs() != end.rotation.coeffs();
  motion.settle = settle && all_pairs && !motion.moving && reach_m == 0.0;
  return motion;
}

walk::Tree arrays_of(const TriangleTree& tree) noexcept {
  return {tree.boxes().data(), tree.nodes().data(), tree.leaves().data()};
}

}  // namespace

TreeWalk::TreeWalk(walk::Kernel kernel)
    : kernel_(kernel != nullptr  ? kernel
              : walk::has_avx2() ? walk::walk_avx2
                                 : walk::walk_portable),
      job_(),
      pairs_(kCapacity),
      stack_(2 * walk::kStack),
      moved_leaves_(walk::kMovedLeavesBytes / sizeof(Line)) {}

void TreeWalk::set_out(const TriangleTree& a, const TriangleTree& b, const Sweep& sweep) noexcept {
  job_ = {arrays_of(a),
          arrays_of(b),
          motion_of(sweep, a.extent_m(), std::sqrt(3.0) * a.extent_m() + b.extent_m()),
          pairs_.data(),
          static_cast<std::uint32_t>(pairs_.size()),
          stack_.data(),
          moved_leaves_.data()};
  job_.begun = a.nodes().empty() || b.nodes().empty();  // then there is nothing to begin with
}

bool TreeWalk::go_on(WalkBudget& budget) noexcept {
  job_.visits = 0;
  job_.visits_allowed = budget.visits;
  kernel_(job_);
  budget.visits -= std::min(budget.visits, job_.visits);
  return job_.stack_top == 0 || job_.overflow;
}

}  // namespace wrenchd
