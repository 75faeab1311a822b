// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/tool_body.hpp"

#include <string>

#include "collision/convex_hull.hpp"
#include "collision/mesh_check.hpp"
#include "collision/mesh_file.hpp"

namespace wrenchd {

ToolBody load_tool(const ToolSettings& settings) {
  TriangleMesh mesh;
  const MeshReport report = check_solid(read_mesh_file(settings.mesh), &mesh);
  if (!report.solid()) {
    std::string message = settings.mesh.string() + ": is not a closed, consistently oriented solid:";
    for (const std::string& defect : report.defects) message += "\n  " + defect;
    throw MeshError(message);
  }
  for (Vector3d& p : mesh.vertices_m) p *= settings.scale;

  ToolBody tool;
  tool.solid = solid_properties(mesh, settings.mass_kg);
  // A scale so small that the volume underflows, or so large that it overflows, leaves nothing to compute with.
  if (!(tool.solid.volume_m3 > 0.0) || !tool.solid.inertia.H_kg_m2.allFinite())
    throw MeshError(settings.mesh.string() + ": has no usable volume at scale " + std::to_string(settings.scale) +
                    "; give 'scale' in metres per mesh unit");
  for (Vector3d& p : mesh.vertices_m) p -= tool.solid.p_MT_m;
  tool.hull = convex_hull(mesh.vertices_m);
  return tool;
}

}  // namespace wrenchd
