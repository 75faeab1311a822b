// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_loader.hpp"
#include "core/convex_body.hpp"
#include "core/inertia.hpp"
#include "core/scene_settings.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The virtual body in the hand. M: frame of the mesh file. T: the body frame, M's axes at the centre of
/// mass.
struct ToolBody {
  SolidProperties solid;  ///< of the uniform solid, in metres and kilograms
  ConvexBody hull;        ///< what a half-space can touch, in T
  TriangleMesh mesh;      ///< the whole surface, in T [m]

  /// Pose of the body frame T in the mesh frame M.
  Pose X_MT() const noexcept { return {Quaterniond::Identity(), solid.p_MT_m}; }
};

/// Throws MeshError where the scale made a solid too small or too large to compute with.
void require_usable(const SolidProperties& solid, const std::filesystem::path& mesh, double scale);

/// A closed, outward-oriented mesh as a uniform solid of this mass. scale: metres per mesh unit. hull: of the
/// mesh, in its units. Not RT safe.
ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, double scale, double mass_kg);
ToolBody tool_body(TriangleMesh mesh, double scale, double mass_kg);

/// Loads and checks the tool's mesh. Throws MeshError that names the file, the defect, its place and the
/// cure. Not RT safe.
ToolBody load_tool(const ToolSettings& settings, MeshLoader& loader);
ToolBody load_tool(const ToolSettings& settings);

}  // namespace wrenchd
