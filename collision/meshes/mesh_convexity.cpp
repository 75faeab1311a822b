// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_convexity.hpp"

#include <algorithm>

#include "collision/meshes/convex_hull.hpp"
#include "core/inertia.hpp"

namespace wrenchd {
namespace {

constexpr double kFull = 1.0 - 1e-6;  // modelling programs round the corners of flat faces
constexpr std::size_t kSome = 20'000;

}  // namespace

bool is_convex(const TriangleMesh& solid, const ConvexBody& hull) {
  return solid_properties(solid, 1.0).volume_m3 >= kFull * volume(hull);
}

// The hull of a sample of the vertices lies in the hull of all vertices.
bool may_be_convex(const TriangleMesh& solid) {
  const std::size_t count = solid.vertices_m.size();
  if (count <= 2 * kSome) return true;
  std::vector<Vector3d> some;
  for (std::size_t i = 0; i < kSome; ++i) some.push_back(solid.vertices_m[i * count / kSome]);
  return is_convex(solid, convex_hull(some));
}

}  // namespace wrenchd
