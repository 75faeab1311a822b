// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/mesh_solid.hpp"

#include <string>

#include "collision/convex_hull.hpp"
#include "collision/mesh_check.hpp"
#include "collision/mesh_file.hpp"
#include "core/inertia.hpp"

namespace wrenchd {

TriangleMesh load_solid(const std::filesystem::path& file) {
  TriangleMesh mesh;
  const MeshReport report = check_solid(read_mesh_file(file), &mesh);
  if (report.solid()) return mesh;
  std::string message = file.string() + ": is not a closed, consistently oriented solid:";
  for (const std::string& defect : report.defects) message += "\n  " + defect;
  throw MeshError(message);
}

bool fills_its_hull(const TriangleMesh& solid, const ConvexBody& hull) {
  constexpr double kFull = 1.0 - 1e-6;  // modelling programs round the corners of flat faces
  return solid_properties(solid, 1.0).volume_m3 >= kFull * volume(hull);
}

}  // namespace wrenchd
