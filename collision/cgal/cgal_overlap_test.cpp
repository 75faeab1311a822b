// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/cgal/cgal_overlap_test.hpp"

#include <algorithm>

#include "collision/cgal/exact_decisions.hpp"

namespace wrenchd {

CgalOverlapTest::CgalOverlapTest(const Scene& scene) : scene_(scene) {
  if (scene.meshes().empty()) return;
  tool_tree_ = CgalMeshTree::of(scene.tool_mesh()->surface);
  for (const MeshObstacle& obstacle : scene.meshes())
    trees_.push_back(CgalMeshTree::of(obstacle.mesh->surface));
}

bool CgalOverlapTest::overlaps(const MeshObstacle& obstacle, const Pose& X_OT) noexcept {
  constexpr double kRounding_m = 1e-9;  // room around the boxes, far above rounding
  const CgalMeshTree& tree = *trees_[static_cast<std::size_t>(&obstacle - scene_.meshes().data())];
  const MeshSurface& tool = tool_tree_->surface();
  const MeshSurface& solid = tree.surface();
  const Frame X(X_OT);
  std::vector<CgalMeshTree::Pair> pairs;
  tree.find_pairs(*tool_tree_, X, X, kRounding_m, pairs);
  const auto intersect = [&](const CgalMeshTree::Pair& pair) {
    return exact::triangles_intersect(
        {X * tool.corner_m(pair.a, 0), X * tool.corner_m(pair.a, 1), X * tool.corner_m(pair.a, 2)},
        {solid.corner_m(pair.b, 0), solid.corner_m(pair.b, 1), solid.corner_m(pair.b, 2)});
  };
  if (std::any_of(pairs.begin(), pairs.end(), intersect)) return true;
  const auto any_shell = [](const MeshSurface& surface, const auto& is_inside) {
    const std::vector<std::uint32_t> shells = shell_triangles(surface);
    return std::any_of(shells.begin(), shells.end(),
                       [&](std::uint32_t t) { return is_inside(surface.corner_m(t, 0)); });
  };
  if (tool.kind() == MeshSurface::Kind::solid &&
      any_shell(solid, [&](const Vector3d& p_O) { return tool_tree_->contains(X.inverse_transform(p_O)); }))
    return true;
  return solid.kind() == MeshSurface::Kind::solid &&
         any_shell(tool, [&](const Vector3d& p_T) { return tree.contains(X * p_T); });
}

}  // namespace wrenchd
