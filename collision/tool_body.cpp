// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/tool_body.hpp"

#include <locale>
#include <sstream>
#include <utility>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_size.hpp"
#include "core/finite.hpp"

namespace wrenchd {

void require_usable(const SolidProperties& solid, const std::filesystem::path& mesh, double scale) {
  // Detects underflow and overflow of volume and inertia.
  const Matrix3d& H = solid.inertia.H_kg_m2;
  if (solid.volume_m3 > 0.0 && is_finite(solid.volume_m3) && H.allFinite() && H.diagonal().minCoeff() > 0.0)
    return;
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << mesh.string() << ": has no usable volume at scale " << scale
       << "; give 'scale' in metres per mesh unit";
  throw MeshError(text.str());
}

// The hull is computed from the unscaled numbers of the file. After scaling and translation a vertex within a
// flat face could lie one rounding error outside and become a hull vertex.
ToolBody tool_body(TriangleMesh mesh, double scale, double mass_kg) {
  ConvexBody hull = convex_hull(mesh.vertices_m);
  return tool_body(std::move(mesh), std::move(hull), scale, mass_kg);
}

ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, double scale, double mass_kg) {
  ToolBody tool;
  tool.hull = std::move(hull);
  for (Vector3d& p : mesh.vertices_m) p *= scale;
  tool.solid = solid_properties(mesh, mass_kg);
  for (Vector3d& p : tool.hull.vertices_T_m) p = p * scale - tool.solid.p_MT_m;
  tool.hull.compute_derived_data();
  for (Vector3d& p : mesh.vertices_m) p -= tool.solid.p_MT_m;
  tool.mesh = std::move(mesh);
  return tool;
}

ToolBody load_tool(const ToolSettings& settings, MeshLoader& loader) {
  const auto loaded = loader.load(settings.mesh, BodyKind::solid, settings.generated);
  ToolBody tool = tool_body(loaded->mesh, loader.hull(*loaded), settings.scale, settings.mass_kg);
  require_usable(tool.solid, settings.mesh, settings.scale);
  loader.check_size(*loaded, settings.scale, kPlausibleToolSize);
  return tool;
}

ToolBody load_tool(const ToolSettings& settings) {
  MeshLoader loader;
  return load_tool(settings, loader);
}

}  // namespace wrenchd
