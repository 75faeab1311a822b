// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/spatial.hpp"
#include "tools/import/cad_reader.hpp"

namespace wrenchd {

/// Kind of a solid that a URDF file describes by numbers. Its centre is at the origin; the axis of a cylinder
/// is z.
enum class Primitive { box, cylinder, sphere };

/// Returns a model with one primitive. size_mm: the sides of a box; radius and length of a cylinder; radius
/// of a sphere. Not RT-safe: allocates.
CadModel primitive_model(Primitive kind, const Vector3d& size_mm, const std::string& name);

}  // namespace wrenchd
