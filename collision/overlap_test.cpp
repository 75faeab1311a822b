// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/overlap_test.hpp"

#include <algorithm>
#include <numeric>

namespace wrenchd {
namespace {

/// Returns true if p is inside a solid: a ray from p leaves it more often than it enters. So a point in two
/// overlapping parts is inside, and a point in a cavity is not. The ray's direction is oblique, because a ray
/// through an edge counts twice or not at all.
bool inside(const MeshSurface& surface, const Vector3d& p) noexcept {
  const Vector3d along(0.8626, 0.3919, 0.3199);
  int count = 0;
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
    const Vector3d a = surface.corner_m(t, 0) - p, b = surface.corner_m(t, 1) - p,
                   c = surface.corner_m(t, 2) - p;
    const double u = along.dot(b.cross(c)), v = along.dot(c.cross(a)), w = along.dot(a.cross(b));
    const bool leaves = u > 0.0 && v > 0.0 && w > 0.0, enters = u < 0.0 && v < 0.0 && w < 0.0;
    if ((leaves || enters) && a.dot(b.cross(c)) / (u + v + w) > 0.0) count += leaves ? 1 : -1;
  }
  return count > 0;
}

}  // namespace

std::vector<std::uint32_t> shell_triangles(const MeshSurface& surface) {
  std::vector<std::uint32_t> into(surface.vertices_m().size());
  std::iota(into.begin(), into.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (into[v] != v) v = into[v] = into[into[v]];
    return v;
  };
  for (const auto& corners : surface.triangles())
    for (const std::uint32_t v : corners) {
      const std::uint32_t a = root(corners[0]), b = root(v);
      into[std::max(a, b)] = std::min(a, b);
    }
  std::vector<bool> known(into.size(), false);
  std::vector<std::uint32_t> out;
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
    const std::uint32_t shell = root(surface.triangles()[t][0]);
    if (!known[shell]) out.push_back(t);
    known[shell] = true;
  }
  return out;
}

NativeOverlapTest::NativeOverlapTest(const Scene& scene) : scene_(scene) {
  if (scene.meshes().empty()) return;
  tool_shells_ = shell_triangles(scene.tool_mesh()->surface);
  for (const MeshObstacle& obstacle : scene.meshes()) {
    const auto [at, is_new] = shells_.try_emplace(obstacle.mesh.get());
    if (is_new) at->second = shell_triangles(obstacle.mesh->surface);
  }
}

/// Two surfaces that do not intersect are apart, or one body contains a shell of the other.
bool NativeOverlapTest::overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept {
  if (!intersecting_pairs_.find(*scene_.tool_mesh(), *obstacle.mesh, X_OT))
    return true;  // too many pairs for a free pose
  if (!intersecting_pairs_.pairs().empty()) return true;
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& other = obstacle.mesh->surface;
  const auto contains = [](const MeshSurface& body, const MeshSurface& surface,
                           const std::vector<std::uint32_t>& shells, const Pose& X) {
    return body.kind() == MeshSurface::Kind::solid &&
           std::any_of(shells.begin(), shells.end(),
                       [&](std::uint32_t t) { return inside(body, X * surface.corner_m(t, 0)); });
  };
  const auto shells = shells_.find(obstacle.mesh.get());
  return (shells != shells_.end() && contains(tool, other, shells->second, inverse(X_OT))) ||
         contains(other, tool, tool_shells_, X_OT);
}

}  // namespace wrenchd
