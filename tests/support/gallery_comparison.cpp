// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/gallery_comparison.hpp"

#include <algorithm>
#include <ctime>
#include <utility>
#include <vector>

#include "collision/penetration.hpp"
#include "core/pose.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "tests/support/gallery_run.hpp"

namespace wrenchd::test {
namespace {

constexpr double kTolerance = 1e-9;    // [m], [rad]
constexpr double kEqualHands = 1e-11;  // [m], [rad]

constexpr std::uint32_t kUnlimitedVisits = 1000000000;

bool settled(std::uint8_t status) {
  return static_cast<ProjectionStatus>(status) == ProjectionStatus::converged ||
         static_cast<ProjectionStatus>(status) == ProjectionStatus::free;
}

bool proxy_valid(const TickRecord& tick) {
  return static_cast<ProxyInitialization>(tick.proxy_initialization) == ProxyInitialization::complete;
}

double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
}

/// Returns the distance of two poses: in translation [m] and in rotation [rad].
std::pair<double, double> distance(const Pose& a, const Pose& b) {
  const double sign = a.rotation.dot(b.rotation) < 0.0 ? -1.0 : 1.0;
  return {(a.translation_m - b.translation_m).norm(),
          2.0 * (a.rotation.coeffs() - sign * b.rotation.coeffs()).norm()};
}

/// Counts one tick of both runs.
void count(long tick, std::uint8_t native_status, const Pose& X_native, std::uint8_t cgal_status,
           const Pose& X_cgal, GalleryComparison& out) {
  out.native_spent += settled(native_status) ? 0 : 1;
  if (!settled(native_status) && out.first_native_spent < 0) out.first_native_spent = tick;
  out.cgal_spent += settled(cgal_status) ? 0 : 1;
  if (out.hands_parted >= 0 || !settled(native_status) || !settled(cgal_status)) return;
  ++out.compared;
  out.equal_bits += same_bits(X_native, X_cgal) ? 1 : 0;
  const auto [away_m, away_rad] = distance(X_native, X_cgal);
  out.largest_m = std::max(out.largest_m, away_m);
  out.largest_rad = std::max(out.largest_rad, away_rad);
  if (std::max(away_m, away_rad) <= kTolerance) return;
  ++out.different;
  if (out.first_different < 0) out.first_different = tick;
}

/// Processor time of this thread, so that other programs do not count.
double processor_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

/// Follows the recorded poses p with a backend. Starts where the recorded proxy became valid.
struct FollowedRun {
  std::vector<Projection> answers;  ///< one for each tick from `first` on
  std::vector<double> us;
  std::size_t first = 0;
};

FollowedRun follow(const GalleryRun& run, const Scene& scene, ContactBackend contacts) {
  PenetrationDepth::Options options;
  options.friction = run.config.settings.rendering.friction;
  options.contacts = contacts;
  // The kernels would defer work to the next tick where CGAL does not. Then the contacts are found elsewhere
  // on the path and held open by another part of the clearance.
  options.work_limit.balanced = false;
  options.work_limit.node_visits = kUnlimitedVisits;
  PenetrationDepth depth(scene, options);
  FollowedRun out;
  while (out.first < run.ticks.size() && !proxy_valid(run.ticks[out.first])) ++out.first;
  if (out.first == 0 || out.first == run.ticks.size()) return out;
  Pose X_WQ = pose_from_numbers(run.ticks[out.first].X_WQ);
  depth.clear_history(run.scene_time_s[out.first]);
  for (std::size_t i = out.first + 1; i < run.ticks.size(); ++i) {
    const double start_us = processor_us();
    const Penetration answer = depth.follow(pose_from_numbers(run.ticks[i].X_WP), X_WQ, run.scene_time_s[i]);
    if (answer.contacts > 0) out.us.push_back(processor_us() - start_us);
    if (answer.projection.status != ProjectionStatus::infeasible) X_WQ = answer.projection.X_WQ;
    out.answers.push_back(answer.projection);
  }
  return out;
}

void compare_open_loop(const GalleryRun& run, GalleryComparison& out) {
  const Scene scene(run.config.scene);
  const FollowedRun native = follow(run, scene, ContactBackend::native);
  const FollowedRun cgal = follow(run, scene, ContactBackend::cgal);
  for (std::size_t i = 0; i < native.answers.size(); ++i)
    count(static_cast<long>(native.first + 1 + i), static_cast<std::uint8_t>(native.answers[i].status),
          native.answers[i].X_WQ, static_cast<std::uint8_t>(cgal.answers[i].status), cgal.answers[i].X_WQ,
          out);
  out.native_p50_us = quantile(native.us, 0.5);
  out.native_p999_us = quantile(native.us, 0.999);
  out.cgal_p50_us = quantile(cgal.us, 0.5);
  out.cgal_p999_us = quantile(cgal.us, 0.999);
}

}  // namespace

GalleryComparison compare_gallery_scene(const std::string& name, bool closed_loop, double seconds) {
  GalleryComparison out;
  const GalleryRun native = run_gallery_scene(name, seconds);
  out.ticks = static_cast<long>(native.ticks.size());
  for (const TickRecord& tick : native.ticks) out.in_contact += tick.contacts > 0 ? 1 : 0;
  if (!closed_loop) {
    compare_open_loop(native, out);
    return out;
  }
  RunConfig config = gallery_config(name);
  config.settings.rendering.contacts = ContactBackend::cgal;
  const GalleryRun cgal = run_gallery_config(config, seconds);
  for (std::size_t i = 0; i < native.ticks.size(); ++i) {
    const TickRecord &a = native.ticks[i], &b = cgal.ticks[i];
    const auto [hands_m, hands_rad] = distance(pose_from_numbers(a.X_WP), pose_from_numbers(b.X_WP));
    if (out.hands_parted < 0 && std::max(hands_m, hands_rad) > kEqualHands)
      out.hands_parted = static_cast<long>(i);
    if (proxy_valid(a) && proxy_valid(b))
      count(static_cast<long>(i), a.projection_status, pose_from_numbers(a.X_WQ), b.projection_status,
            pose_from_numbers(b.X_WQ), out);
  }
  return out;
}

}  // namespace wrenchd::test
