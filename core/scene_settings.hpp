// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/generated_mesh.hpp"
#include "core/obstacle_motion.hpp"
#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The body whose inertia the tool has.
enum class InertiaSource : std::uint8_t {
  solid,  ///< the uniform solid that the mesh bounds
  hull,   ///< the uniform solid that the convex hull of the mesh bounds
  shell,  ///< a uniform shell along the faces of the mesh
  given,  ///< the scene states the centre of mass and the inertia tensor
};

/// The tool: the virtual body that the user moves. M: frame of the mesh file.
struct ToolSettings {
  std::filesystem::path mesh;  ///< OFF, OBJ, STL or PLY file; a relative path is relative to the scene file
  double scale = 1.0;          ///< metres per mesh unit
  double mass_kg = 1.0;        ///< mass of the tool; it scales T and moves no minimizer
  std::optional<GeneratedMesh> generated =
      {};  ///< mesh that wrenchd generates; then `mesh` is its generated_mesh_name() instead of a file
  /// Files of the parts of a tool that consists of several, the first one equal to `mesh`. Empty: one mesh.
  std::vector<std::filesystem::path> parts = {};
  /// A surface may be open or intersect itself. Its inertia cannot be that of the solid.
  BodyKind kind = BodyKind::solid;
  InertiaSource inertia_source = InertiaSource::solid;
  double shell_thickness_m = 0.0;                 ///< for InertiaSource::shell
  Vector3d centre_of_mass_m = Vector3d::Zero();   ///< in M, for InertiaSource::given
  Matrix3d inertia_kg_m2 = Matrix3d::Identity();  ///< about the centre of mass, axes of M, for given
};

/// Solid half-space normal_W . x < offset_m.
struct HalfSpaceSettings {
  std::string name;
  Vector3d normal_W = Vector3d::UnitZ();  ///< unit normal, points out of the solid
  double offset_m = 0.0;
};

/// An obstacle with a mesh, at rest or moving. M: frame of the mesh file.
struct MeshObstacleSettings {
  std::string name;
  std::filesystem::path mesh;
  double scale = 1.0;  ///< metres per mesh unit
  Pose X_WM;           ///< pose at scene time 0
  /// A solid must be closed. A surface may be open or intersect itself; it has no inside, so it does not push
  /// out a tool that starts behind it or passes through it.
  BodyKind kind = BodyKind::solid;
  ObstacleMotion motion = {};  ///< motion of M; rotation is about the origin of M
  std::optional<ScheduledMotion> scheduled = {};
  /// mesh that wrenchd generates; then `mesh` is its generated_mesh_name() instead of a file
  std::optional<GeneratedMesh> generated = {};
  /// Files of the parts of an obstacle that consists of several, the first one equal to `mesh`. Empty: one
  /// mesh.
  std::vector<std::filesystem::path> parts = {};
};

/// A rigid body that moves by itself. Its shape and inertia are given as those of a tool. M: frame of the
/// mesh file.
struct BodySettings {
  std::string name;
  ToolSettings shape;
  std::optional<double> density_kg_per_m3;       ///< gives the mass, in place of shape.mass_kg
  Pose X_WM;                                     ///< pose at the start
  Vector3d velocity_m_per_s = Vector3d::Zero();  ///< of the centre of mass at the start, in W
  Vector3d spin_rad_per_s = Vector3d::Zero();    ///< angular velocity at the start, in W
  double friction = 0.5;                         ///< coefficient against obstacles
  double restitution = 0.0;                      ///< speed after an impact over that before it
  double linear_damping_per_s = 0.0;
  double angular_damping_per_s = 0.0;
};

/// Returns the files of the meshes of a body; none if wrenchd generates its mesh. Not RT-safe: allocates.
template <class Body>
std::vector<std::filesystem::path> mesh_files(const Body& body) {
  if (body.generated) return {};
  return body.parts.empty() ? std::vector<std::filesystem::path>{body.mesh} : body.parts;
}

struct SceneSettings {
  std::filesystem::path file;  ///< source file, for messages
  ToolSettings tool;
  std::vector<HalfSpaceSettings> half_spaces;
  std::vector<MeshObstacleSettings> meshes;
  static constexpr std::size_t kMaxBodies = 8;
  std::vector<BodySettings> bodies;
  Vector3d gravity_W_m_per_s2 = {0.0, 0.0, -9.81};  ///< acts on the bodies
  /// Contacts may use a surface that encloses a solid and lies at most this far outside of it [m]; 0: the
  /// mesh as loaded. Rounding of single precision may raise it (collision/meshes/mesh_simplifier.hpp).
  double surface_tolerance_m = 1e-6;
  /// Contacts use curved surfaces through the vertices of the meshes, at most this far from their faces [m];
  /// 0: the faces (collision/meshes/mesh_smoother.hpp). Not a key of the scene but of [rendering].
  double smoothing_m = 0.0;
  std::string text = {};  ///< content of the source file as it was read; empty: not from a file
};

}  // namespace wrenchd
