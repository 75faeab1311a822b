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

/// The uniform solid inside a closed, outward-oriented mesh. M is the frame of the mesh; T has M's axes.
struct SolidProperties {
  double volume_m3 = 0.0;
  Vector3d p_MT_m = Vector3d::Zero();  ///< centre of mass in M
  Inertia inertia;                     ///< about T
};

/// Volume, centre of mass and inertia of the uniform solid of the given total mass.
/// The mesh must be closed and outward-oriented; a volume that is not positive is returned as it is, with
/// the inertia left at its default. Not RT safe.
SolidProperties solid_properties(const TriangleMesh& mesh, double mass_kg);

}  // namespace wrenchd
