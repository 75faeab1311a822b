// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/overlap_test.hpp"

namespace wrenchd {
namespace {

/// Returns true if p is inside a closed surface: a ray from p crosses it an odd number of times. The ray's
/// direction is oblique, because a ray through an edge counts twice or not at all.
bool inside(const MeshSurface& surface, const Vector3d& p) noexcept {
  const Vector3d along(0.8626, 0.3919, 0.3199);
  bool odd = false;
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
    const Vector3d a = surface.corner_m(t, 0) - p, b = surface.corner_m(t, 1) - p,
                   c = surface.corner_m(t, 2) - p;
    const double u = along.dot(b.cross(c)), v = along.dot(c.cross(a)), w = along.dot(a.cross(b));
    const bool through = (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0);
    if (through && a.dot(b.cross(c)) / (u + v + w) > 0.0) odd = !odd;
  }
  return odd;
}

}  // namespace

/// Two surfaces that do not intersect are apart, or one body contains the other.
bool NativeOverlapTest::overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept {
  if (!intersecting_pairs_.find(*scene_.tool_mesh(), *obstacle.mesh, X_OT))
    return true;  // too many pairs for a free pose
  if (!intersecting_pairs_.pairs().empty()) return true;
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& solid = obstacle.mesh->surface;
  if (inside(tool, inverse(X_OT) * solid.corner_m(0, 0))) return true;
  return solid.kind() == MeshSurface::Kind::solid && inside(solid, X_OT * tool.corner_m(0, 0));
}

}  // namespace wrenchd
