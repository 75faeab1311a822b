// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/sweep_comparison.hpp"

#include <algorithm>
#include <sstream>

namespace wrenchd::test {
namespace {

constexpr std::uint32_t kUnlimited = 1000000000;

bool same_pair(const Contact& a, const Contact& b) {
  return a.kind == b.kind && a.tool_feature == b.tool_feature && a.obstacle_feature == b.obstacle_feature &&
         a.obstacle == b.obstacle;
}

double difference(const Contact& a, const Contact& b) {
  return std::max({(a.p_TCa_m - b.p_TCa_m).norm(), (a.p_WCb_m - b.p_WCb_m).norm(), (a.n_W - b.n_W).norm(),
                   std::abs(a.offset_m - b.offset_m), (a.d_T - b.d_T).norm(), (a.d_W - b.d_W).norm()});
}

bool all_in(const ContactSet& some, const ContactSet& all) {
  return std::all_of(some.begin(), some.end(), [&](const Contact& c) { return all.contains(c); });
}

std::string text(const Contact& c) {
  std::ostringstream out;
  out << (c.kind == ContactKind::vertex_face   ? "vf"
          : c.kind == ContactKind::face_vertex ? "fv"
                                               : "ee")
      << ' ' << c.tool_feature << '/' << c.obstacle_feature;
  return out.str();
}

/// Returns the pose on the path at which the tool has rotated by as much as a proxy's step may.
Pose part_of_path(const Pose& X_start, const Pose& X_end) {
  constexpr double kMaxRotation_rad = 0.05;
  const double angle = X_start.rotation.angularDistance(X_end.rotation);
  const double part = angle > kMaxRotation_rad ? kMaxRotation_rad / angle : 1.0;
  return {X_start.rotation.slerp(part, X_end.rotation),
          X_start.translation_m + part * (X_end.translation_m - X_start.translation_m)};
}

template <class Contacts>
std::string list(const Contacts& contacts) {
  std::string all;
  for (const Contact& c : contacts) all += (all.empty() ? "" : ", ") + text(c);
  return all;
}

std::string text(const Pose& X) {
  std::ostringstream out;
  out.precision(17);
  out << X.translation_m.transpose() << " | " << X.rotation.coeffs().transpose();
  return out.str();
}

}  // namespace

void SweepCounts::add(const SweepCounts& other) {
  sweeps += other.sweeps;
  crossed += other.crossed;
  contacts += other.contacts;
  touching += other.touching;
  overlaps += other.overlaps;
  different += other.different;
  largest_difference = std::max(largest_difference, other.largest_difference);
  if (first_difference.empty()) first_difference = other.first_difference;
}

void SweepComparison::report(const std::string& what, const Pose& X_start, const Pose& X_end) {
  ++counts_.different;
  if (counts_.first_difference.empty())
    counts_.first_difference = what + "; from " + text(X_start) + " to " + text(X_end);
}

void SweepComparison::compare(const Pose& X_start, const Pose& X_end) {
  VisitBudget budget = {kUnlimited}, unused = {kUnlimited};
  native_.prefetch(X_start, X_start, unused);  // both forget the overlaps of the last tick
  cgal_.prefetch(X_start, X_start, unused);
  native_.reset();
  native_.set_start(X_start);
  cgal_.set_start(X_start);
  const auto fast = native_.sweep(X_end, Proxy::kClearance_m, budget);
  if (!fast.complete) return;  // more pairs than room
  const auto exact = cgal_.sweep(X_end, Proxy::kClearance_m, budget);
  ++counts_.sweeps;
  counts_.crossed += exact.contacts.empty() ? 0 : 1;
  counts_.contacts += static_cast<long>(exact.contacts.size());
  counts_.touching += static_cast<long>(cgal_.touching().size());
  counts_.overlaps += exact.contacts.empty() && exact.overlaps ? 1 : 0;
  const bool same = std::equal(fast.contacts.begin(), fast.contacts.end(), exact.contacts.begin(),
                               exact.contacts.end(), same_pair);
  if (!same) return report("met " + list(fast.contacts) + "; CGAL: " + list(exact.contacts), X_start, X_end);
  for (std::size_t i = 0; i < fast.contacts.size(); ++i)
    counts_.largest_difference =
        std::max(counts_.largest_difference, difference(fast.contacts[i], exact.contacts[i]));
  if (exact.contacts.empty() && fast.overlaps != exact.overlaps)
    return report(fast.overlaps ? "overlaps; CGAL: does not" : "does not overlap; CGAL: does", X_start,
                  X_end);
  const bool full = native_.touching().size() == ContactSet::kCapacity;
  if (!full &&
      !(all_in(native_.touching(), cgal_.touching()) && all_in(cgal_.touching(), native_.touching())))
    report("touches " + list(native_.touching()) + "; CGAL: " + list(cgal_.touching()), X_start, X_end);
}

SweepCounts compare_sweeps(const ManipulationCase& handling, int ticks, int random_paths,
                           std::uint64_t seed) {
  const Scene scene = scene_of(handling);
  SweepComparison comparison(scene);
  Proxy proxy(scene);
  HandTrajectory hand(handling, seed);
  RandomValues random(seed);
  Pose X_WQ = {Quaterniond::Identity(), handling.start_m};
  for (int n = 0; n < ticks; ++n) {
    const Pose X_WP = hand.next();
    comparison.compare(X_WQ, part_of_path(X_WQ, X_WP));
    for (int k = 0; k < random_paths; ++k) {
      const double step_m = random.log_uniform(1e-9, 0.02);
      const double angle = random.log_uniform(1e-9, 0.05);
      comparison.compare(X_WQ, {(X_WQ.rotation * rotation_from(angle * random.unit<3>())).normalized(),
                                X_WQ.translation_m + step_m * random.unit<3>()});
    }
    const Projection q = proxy.follow(X_WP, X_WQ);
    if (q.status == ProjectionStatus::infeasible) continue;
    comparison.compare(X_WQ, q.X_WQ);  // the loaded contacts touch at its end
    X_WQ = q.X_WQ;
  }
  return comparison.counts();
}

}  // namespace wrenchd::test
