// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/trajectory_run.hpp"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <limits>

#include "core/energy_law.hpp"

namespace wrenchd::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Returns the processor time of this thread [us]. Other programs on the same core do not count.
double thread_time_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

void follow_once(const Scene& scene, const Proxy::WorkLimit& limit, const std::vector<Pose>& X_WP,
                 std::vector<ProxyTick>& ticks) {
  Proxy proxy(scene, limit);
  Pose X_WQ = X_WP.front();
  for (std::size_t i = 0; i < X_WP.size(); ++i) {
    ProxyTick& tick = ticks[i];
    const double begin_us = thread_time_us();
    const Projection q = proxy.follow(X_WP[i], X_WQ, 1e-3 * static_cast<double>(i));
    const Wrench F_T = energy_wrench(scene.tool().solid.inertia, kStiffness_per_s2, X_WP[i], q.X_WQ);
    tick.us = std::min(tick.us, thread_time_us() - begin_us);
    if (q.status != ProjectionStatus::infeasible) X_WQ = q.X_WQ;
    tick.X_WQ = X_WQ;
    tick.status = q.status;
    tick.force_W_N = X_WP[i].rotation * F_T.force_N;
    tick.node_visits = proxy.node_visits();
  }
}

}  // namespace

std::vector<ProxyTick> follow_trajectory(const Scene& scene, const Proxy::WorkLimit& limit,
                                         const std::vector<Pose>& X_WP, int passes, double max_s) {
  std::vector<ProxyTick> ticks(X_WP.size());
  for (ProxyTick& tick : ticks) tick.us = std::numeric_limits<double>::infinity();
  const auto begin = Clock::now();
  for (int pass = 0; pass < passes && seconds_since(begin) < max_s; ++pass)
    follow_once(scene, limit, X_WP, ticks);
  return ticks;
}

Proxy::WorkLimit unlimited_work() {
  return {10'000, 2'000'000'000, false};
}

double pose_difference_m(const Pose& X_WA, const Pose& X_WB,
                         const std::vector<Vector3d>& corners_m) noexcept {
  double largest = 0.0;
  for (const Vector3d& p : corners_m) largest = std::max(largest, (X_WA * p - X_WB * p).norm());
  return largest;
}

std::vector<Vector3d> box_corners(const TriangleMesh& mesh) {
  Vector3d low = mesh.vertices_m.front(), high = low;
  for (const Vector3d& p : mesh.vertices_m) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  std::vector<Vector3d> corners;
  for (unsigned i = 0; i < 8; ++i)
    corners.emplace_back((i & 1u) ? high.x() : low.x(), (i & 2u) ? high.y() : low.y(),
                         (i & 4u) ? high.z() : low.z());
  return corners;
}

LagReport compare(const std::vector<ProxyTick>& run, const Pose& X_TC,
                  const std::vector<ProxyTick>& reference, const Pose& X_RC,
                  const std::vector<Vector3d>& corners_m, double tolerance_m) {
  LagReport report;
  std::size_t behind = 0, run_ticks = 0;
  double run_m = 0.0;
  for (std::size_t i = 0; i < run.size(); ++i) {
    const double apart_m = pose_difference_m(run[i].X_WQ * X_TC, reference[i].X_WQ * X_RC, corners_m);
    report.largest_m = std::max(report.largest_m, apart_m);
    report.force_N = std::max(report.force_N, run[i].force_W_N.norm());
    report.reference_force_N = std::max(report.reference_force_N, reference[i].force_W_N.norm());
    report.force_difference_N =
        std::max(report.force_difference_N, (run[i].force_W_N - reference[i].force_W_N).norm());
    if (apart_m <= tolerance_m) {
      run_ticks = 0;
      run_m = 0.0;
      continue;
    }
    ++behind;
    run_m = std::max(run_m, apart_m);
    if (++run_ticks < report.longest_ticks) continue;
    report.longest_ticks = run_ticks;
    report.longest_run_m = run_m;
  }
  report.behind_share = static_cast<double>(behind) / static_cast<double>(run.size());
  return report;
}

double share_of(const std::vector<ProxyTick>& run, ProjectionStatus status) {
  return static_cast<double>(
             std::count_if(run.begin(), run.end(), [&](const ProxyTick& t) { return t.status == status; })) /
         static_cast<double>(run.size());
}

}  // namespace wrenchd::bench
