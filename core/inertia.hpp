// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Mass properties of a rigid body, Eq. (13), with the body frame T at the centre of mass: M = diag(m I, H).
struct Inertia {
  double mass_kg = 1.0;
  Matrix3d H_kg_m2 = Matrix3d::Identity();  ///< inertia tensor about the centre of mass, in T
};

/// Mass properties of the uniform solid bounded by a mesh. M: mesh frame. T has the axes of M.
struct SolidProperties {
  double volume_m3 = 0.0;
  Vector3d p_MT_m = Vector3d::Zero();  ///< centre of mass in M
  Inertia inertia;                     ///< inertia about the origin of T
};

/// Volume, centre of mass and inertia of the uniform solid with the given total mass, METHOD (16). The mesh
/// must be closed and oriented outward. If the volume is not positive, returns it and leaves the inertia at
/// its default. Not RT-safe: linear in the number of triangles.
SolidProperties solid_properties(const TriangleMesh& mesh, double mass_kg);

/// Area times thickness, centre of mass and inertia of a uniform shell along the faces of a mesh, with the
/// given total mass. Half of the thickness lies on each side of a face. The mesh may be open and may
/// intersect itself. If the area is zero, leaves the inertia at its default. Not RT-safe: linear in the
/// number of triangles.
SolidProperties shell_properties(const TriangleMesh& mesh, double mass_kg, double thickness_m);

}  // namespace wrenchd
