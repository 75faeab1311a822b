// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/solve_table.hpp"

#include <ostream>

#include "tools/csv_row.hpp"

namespace wrenchd {
namespace {

constexpr const char* kHeader =
    "contacts,energy,px,py,pz,qx,qy,qz,qw,eps_vx,eps_vy,eps_vz,eps_wx,eps_wy,eps_wz,"
    "body_fx,body_fy,body_fz,body_tx,body_ty,body_tz,"
    "spatial_fx,spatial_fy,spatial_fz,spatial_tx,spatial_ty,spatial_tz,solve_ns";

}  // namespace

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
