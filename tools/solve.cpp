// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/solve.hpp"

#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <ostream>

#include "core/energy_law.hpp"
#include "tools/csv_row.hpp"

namespace wrenchd {
namespace {

constexpr const char* kHeader =
    "contacts,energy,px,py,pz,qx,qy,qz,qw,eps_vx,eps_vy,eps_vz,eps_wx,eps_wy,eps_wz,"
    "body_fx,body_fy,body_fz,body_tx,body_ty,body_tz,"
    "spatial_fx,spatial_fy,spatial_fz,spatial_tx,spatial_ty,spatial_tz,solve_ns";

const char* status_name(ProjectionStatus status) {
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

}  // namespace

std::vector<SolvedPose> solve(const Scene& scene, const std::vector<Pose>& X_WM,
                              const SolveSettings& settings) {
  const ToolBody& tool = scene.tool();
  const Pose X_MT = tool.X_MT();
  const Pose X_TM = inverse(X_MT);
  PenetrationDepth::Options options = settings.depth;
  if (settings.proxy) options.clearance_m = Proxy::kClearance_m;
  PenetrationDepth depth(scene, options);
  std::optional<Pose> X_last;  // previous pose of the proxy
  WrenchGains gains;
  gains.stiffness = WrenchGains::scalar(settings.k_P);
  WrenchLaw law(gains_for(settings.depth.method, gains));

  std::vector<SolvedPose> rows;
  rows.reserve(X_WM.size());
  for (const Pose& X_WM_p : X_WM) {
    const Pose X_WP = X_WM_p * X_MT;
    const double scene_time_s = settings.proxy ? static_cast<double>(rows.size()) / settings.rate_Hz : 0.0;
    SolvedPose row;
    const auto start = std::chrono::steady_clock::now();
    row.penetration =
        X_last ? depth.follow(X_WP, *X_last, scene_time_s) : depth.query(X_WP, {}, scene_time_s);
    row.solve_ns = std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count();
    if (settings.proxy && row.penetration.projection.status != ProjectionStatus::infeasible)
      X_last = row.penetration.projection.X_WQ;
    const bool moved = row.penetration.projection.status != ProjectionStatus::free;
    row.X_WM = moved ? row.penetration.projection.X_WQ * X_TM : X_WM_p;
    row.F_T = settings.law == SpringLaw::pid
                  ? law.update(row.penetration.spring_displacement, row.penetration.contacts > 0, 0.0)
                  : energy_wrench(tool.solid.inertia, settings.energy_stiffness_per_s2, X_WP,
                                  row.penetration.projection.X_WQ);
    row.F_S = spatial_wrench(X_WP, row.F_T);
    if (row.penetration.projection.status == ProjectionStatus::infeasible)
      row.penetration.projection.energy = row.penetration.projection.kkt_residual =
          std::numeric_limits<double>::quiet_NaN();
    rows.push_back(row);
  }
  return rows;
}

void write_csv(std::ostream& out, const std::vector<SolvedPose>& rows, bool proxy) {
  out << kHeader << (proxy ? ",status,iterations" : "") << ",kkt_residual\n";
  for (const SolvedPose& r : rows) {
    const Quaterniond& q = r.X_WM.rotation;
    CsvRow row(out);
    row << r.penetration.contacts << r.penetration.projection.energy << r.X_WM.translation_m << q.x() << q.y()
        << q.z() << q.w();
    row << Vector3d(r.penetration.eps.head<3>()) << Vector3d(r.penetration.eps.tail<3>());
    row << r.F_T.force_N << r.F_T.torque_Nm << r.F_S.force_N << r.F_S.torque_Nm << r.solve_ns;
    if (proxy) row << status_name(r.penetration.projection.status) << r.penetration.projection.iterations;
    row << r.penetration.projection.kkt_residual;
  }
}

}  // namespace wrenchd
