// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/convex_body.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Is a solid convex, but for what rounding of its corners takes away? Not RT safe.
bool is_convex(const TriangleMesh& solid, const ConvexBody& hull);

/// False where some of the vertices alone tell that it is not; true where the hull has to. Quick. Not RT
/// safe.
bool may_be_convex(const TriangleMesh& solid);

}  // namespace wrenchd
