// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "collision/meshes/mesh_loader.hpp"
#include "core/convex_body.hpp"
#include "core/inertia.hpp"
#include "core/scene_settings.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The virtual body in the hand. M: frame of the mesh file. T: body frame, parallel to M, with its origin at
/// the centre of mass.
struct ToolBody {
  /// Properties of the body that gives the inertia (InertiaSource), in metres and kilograms. A tool with a
  /// given inertia has the volume of its solid, or of its convex hull if it is a surface.
  SolidProperties solid;
  ConvexBody hull;    ///< convex hull in T; the part of the tool that half-spaces touch
  TriangleMesh mesh;  ///< complete surface in T [m]
  BodyKind kind = BodyKind::solid;

  /// Returns the pose of the body frame T in the mesh frame M. RT-safe.
  Pose X_MT() const noexcept { return {Quaterniond::Identity(), solid.p_MT_m}; }
};

/// Throws MeshError if the scale makes the solid too small or too large for floating-point arithmetic. Not
/// RT-safe: allocates.
void require_usable(const SolidProperties& solid, const std::filesystem::path& mesh, double scale);

/// Returns a closed, outward-oriented mesh as a uniform solid. scale: metres per mesh unit. hull: convex hull
/// in mesh units; computed from the mesh if omitted. Not RT-safe: allocates, may take seconds.
ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, double scale, double mass_kg);
ToolBody tool_body(TriangleMesh mesh, double scale, double mass_kg);
/// Returns a mesh as a tool of the kind and with the inertia of the settings.
ToolBody tool_body(TriangleMesh mesh, ConvexBody hull, const ToolSettings& settings);

/// Returns the convex hull, in T, of the surface that contacts of a body use. file: name of its mesh. Not
/// RT-safe: allocates, may take seconds.
ConvexBody hull_of(const MeshBvh& surface, const std::filesystem::path& file, MeshLoader& loader);

/// Returns what gives the inertia of a tool, for messages: "its inertia is that of its convex hull". Not
/// RT-safe: allocates.
std::string inertia_text(const ToolSettings& settings);

/// Loads and checks the tool's mesh. Throws MeshError that names the file, the defect, its place and the
/// remedy. Not RT-safe: reads a file, may take seconds.
ToolBody load_tool(const ToolSettings& settings, MeshLoader& loader);
ToolBody load_tool(const ToolSettings& settings);

}  // namespace wrenchd
