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

namespace {

/// Returns the mass properties of the tool. mesh, hull: in M [m].
SolidProperties properties(const TriangleMesh& mesh, const ConvexBody& hull, const ToolSettings& settings) {
  switch (settings.inertia_source) {
    case InertiaSource::solid:
      return solid_properties(mesh, settings.mass_kg);
    case InertiaSource::hull:
      return solid_properties(hull_surface(hull), settings.mass_kg);
    case InertiaSource::shell:
      return shell_properties(mesh, settings.mass_kg, settings.shell_thickness_m);
    case InertiaSource::given:
      break;
  }
  SolidProperties given;
  given.volume_m3 = settings.kind == BodyKind::solid ? solid_properties(mesh, 1.0).volume_m3 : volume(hull);
  given.p_MT_m = settings.centre_of_mass_m;
  given.inertia = {settings.mass_kg, settings.inertia_kg_m2};
  return given;
}

}  // namespace

ToolBody tool_body(TriangleMesh mesh, double scale, double mass_kg) {
  ConvexBody hull = convex_hull(mesh);
  return tool_body(std::move(mesh), std::move(hull), scale, mass_kg);
}

ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, double scale, double mass_kg) {
  ToolSettings settings;
  settings.scale = scale;
  settings.mass_kg = mass_kg;
  return tool_body(std::move(mesh), std::move(hull), settings);
}

// The hull is computed from the unscaled numbers of the file. After scaling and translation a vertex within a
// flat face could lie one rounding error outside and become a hull vertex.
ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, const ToolSettings& settings) {
  ToolBody tool;
  tool.kind = settings.kind;
  tool.hull = std::move(hull);
  for (Vector3d& p : mesh.vertices_m) p *= settings.scale;
  for (Vector3d& p : tool.hull.vertices_T_m) p *= settings.scale;
  tool.solid = properties(mesh, tool.hull, settings);
  for (Vector3d& p : tool.hull.vertices_T_m) p -= tool.solid.p_MT_m;
  tool.hull.compute_derived_data();
  for (Vector3d& p : mesh.vertices_m) p -= tool.solid.p_MT_m;
  tool.mesh = std::move(mesh);
  return tool;
}

ConvexBody hull_of(const MeshBvh& surface, const std::filesystem::path& file, MeshLoader& loader) {
  LoadedMesh mesh;
  mesh.file = file;
  mesh.mesh = surface.surface.mesh();
  ConvexBody hull = loader.hull(mesh);
  hull.compute_derived_data();
  return hull;
}

std::string inertia_text(const ToolSettings& settings) {
  switch (settings.inertia_source) {
    case InertiaSource::solid:
      return "its inertia is that of the uniform solid";
    case InertiaSource::hull:
      return "its inertia is that of its convex hull, filled uniformly";
    case InertiaSource::shell: {
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text << "its inertia is that of a shell of " << 1e3 * settings.shell_thickness_m
           << " mm along its faces";
      return text.str();
    }
    case InertiaSource::given:
      break;
  }
  return "its centre of mass and inertia are those of the scene";
}

ToolBody load_tool(const ToolSettings& settings, MeshLoader& loader) {
  const auto loaded = settings.parts.empty() ? loader.load(settings.mesh, settings.kind, settings.generated)
                                             : loader.load_parts(settings.parts, settings.kind);
  ToolBody tool = tool_body(loaded->mesh, loader.hull(*loaded), settings);
  require_usable(tool.solid, settings.mesh, settings.scale);
  loader.check_size(*loaded, settings.scale, kPlausibleToolSize);
  if (settings.inertia_source != InertiaSource::solid)
    loader.add_change(loaded->file.string() + ": as the tool, " + inertia_text(settings));
  return tool;
}

ToolBody load_tool(const ToolSettings& settings) {
  MeshLoader loader;
  return load_tool(settings, loader);
}

}  // namespace wrenchd
