// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/convex_body.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Returns true if the solid fills its convex hull except for the rounding of its corners. Not RT-safe: may
/// take milliseconds.
bool is_convex(const TriangleMesh& solid, const ConvexBody& hull);

/// Returns false if a sample of the vertices proves that the solid is not convex. True means that is_convex()
/// must decide. Not RT-safe: allocates.
bool may_be_convex(const TriangleMesh& solid);

}  // namespace wrenchd
