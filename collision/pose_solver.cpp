// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pose_solver.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <optional>
#include <utility>

#include "collision/clearance.hpp"
#include "collision/contact_detection.hpp"
#include "core/energy_law.hpp"

namespace wrenchd {
namespace {

WrenchLaw make_law(const SolveSettings& settings) {
  WrenchGains gains;
  gains.stiffness = WrenchGains::scalar(settings.k_P);
  return WrenchLaw(gains_for(settings.depth.method, gains));
}

/// Returns the answer of `solve` and its duration [ns].
template <class Solve>
std::pair<Penetration, double> timed(const Solve& solve) {
  const auto start = std::chrono::steady_clock::now();
  Penetration penetration = solve();
  const auto end = std::chrono::steady_clock::now();
  return {std::move(penetration), std::chrono::duration<double, std::nano>(end - start).count()};
}

}  // namespace

const char* status_name(ProjectionStatus status) noexcept {
  switch (status) {
    case ProjectionStatus::free:
      return "free";
    case ProjectionStatus::converged:
      return "converged";
    case ProjectionStatus::budget_spent:
      return "iteration_limit";
    case ProjectionStatus::infeasible:
      break;
  }
  return "infeasible";
}

PoseSolver::PoseSolver(const Scene& scene, const SolveSettings& settings)
    : scene_(scene), settings_(settings), depth_(scene, settings.depth), law_(make_law(settings)) {}

SolvedPose PoseSolver::project(const Pose& X_WM, double scene_time_s) {
  const Pose X_WP = X_WM * scene_.tool().X_MT();
  const auto [penetration, solve_ns] = timed([&] { return depth_.query(X_WP, {}, scene_time_s); });
  return answer(X_WM, penetration, solve_ns);
}

std::vector<SolvedPose> PoseSolver::follow(std::span<const Pose> X_WM, double rate_Hz) {
  std::vector<SolvedPose> rows;
  rows.reserve(X_WM.size());
  follow(X_WM, rate_Hz, [&](const Pose&, SolvedPose solved) { rows.push_back(std::move(solved)); });
  return rows;
}

void PoseSolver::follow(std::span<const Pose> X_WM, double rate_Hz,
                        const std::function<void(const Pose&, SolvedPose)>& take) {
  PenetrationDepth::Options options = settings_.depth;
  options.clearance_m = Proxy::kClearance_m;
  PenetrationDepth depth(scene_, options);
  std::optional<Pose> X_last;  // previous pose of the proxy
  for (std::size_t i = 0; i < X_WM.size(); ++i) {
    const Pose X_WP = X_WM[i] * scene_.tool().X_MT();
    const double scene_time_s = static_cast<double>(i) / rate_Hz;
    const auto [penetration, solve_ns] = timed([&] {
      return X_last ? depth.follow(X_WP, *X_last, scene_time_s) : depth.query(X_WP, {}, scene_time_s);
    });
    if (penetration.projection.status != ProjectionStatus::infeasible) X_last = penetration.projection.X_WQ;
    take(X_WM[i], answer(X_WM[i], penetration, solve_ns));
  }
}

bool PoseSolver::overlaps(const Pose& X_WM, double scene_time_s) {
  const ToolBody& tool = scene_.tool();
  const Pose X_WT = X_WM * tool.X_MT();
  for (const HalfSpaceSettings& half_space : scene_.half_spaces())
    for (const Vector3d& p_T : tool.hull.vertices_T_m)
      if (half_space.normal_W.dot(X_WT * p_T) <= half_space.offset_m) return true;
  if (scene_.meshes().empty()) return false;
  if (!overlap_test_) overlap_test_ = make_overlap_test(scene_, settings_.depth.contacts);
  return std::any_of(scene_.meshes().begin(), scene_.meshes().end(), [&](const MeshObstacle& obstacle) {
    return overlap_test_->overlaps(obstacle, inverse(obstacle.X_WO_at(scene_time_s)) * X_WT);
  });
}

double PoseSolver::clearance_m(const Pose& X_WM, double scene_time_s) {
  if (overlaps(X_WM, scene_time_s)) return 0.0;
  return wrenchd::clearance_m(scene_, X_WM * scene_.tool().X_MT(), scene_time_s);
}

SolvedPose PoseSolver::answer(const Pose& X_WM, const Penetration& penetration, double solve_ns) {
  const ToolBody& tool = scene_.tool();
  const Pose X_WP = X_WM * tool.X_MT();
  SolvedPose out;
  out.penetration = penetration;
  out.solve_ns = solve_ns;
  Projection& projection = out.penetration.projection;
  const bool moved = projection.status != ProjectionStatus::free;
  out.X_WM = moved ? projection.X_WQ * inverse(tool.X_MT()) : X_WM;
  out.F_T = settings_.law == SpringLaw::pid
                ? law_.update(penetration.spring_displacement, penetration.contacts > 0, 0.0)
                : energy_wrench(tool.solid.inertia, settings_.energy_stiffness_per_s2, X_WP, projection.X_WQ);
  out.F_S = spatial_wrench(X_WP, out.F_T);
  if (projection.status == ProjectionStatus::infeasible)
    projection.energy = projection.kkt_residual = std::numeric_limits<double>::quiet_NaN();
  return out;
}

}  // namespace wrenchd
