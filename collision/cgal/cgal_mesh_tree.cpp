// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/cgal/cgal_mesh_tree.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <mutex>
#include <utility>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

namespace wrenchd {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Traits = CGAL::AABB_traits<Kernel, Primitive>;
using AabbTree = CGAL::AABB_tree<Traits>;

Point to_point(const Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}

/// A motion on a straight path, and the room around it that counts as near.
struct Path {
  const Frame& start;
  const Frame& end;
  double margin_m;
};

/// Returns the box around a box that moves.
CGAL::Bbox_3 box_around(const CGAL::Bbox_3& box, const Path& path) {
  const Vector3d low(box.xmin(), box.ymin(), box.zmin()), high(box.xmax(), box.ymax(), box.zmax());
  const Vector3d centre = 0.5 * (low + high), half = 0.5 * (high - low);
  const Vector3d c0 = path.start * centre, c1 = path.end * centre;
  const Vector3d h0 = path.start.R.cwiseAbs() * half, h1 = path.end.R.cwiseAbs() * half;
  const Vector3d margin = Vector3d::Constant(path.margin_m);
  const Vector3d from = (c0 - h0).cwiseMin(c1 - h1) - margin, to = (c0 + h0).cwiseMax(c1 + h1) + margin;
  return {from.x(), from.y(), from.z(), to.x(), to.y(), to.z()};
}

/// Returns the box around a triangle that moves.
CGAL::Bbox_3 box_around(const Kernel::Triangle_3& triangle, const Path& path) {
  CGAL::Bbox_3 box;
  for (int i = 0; i < 3; ++i)
    for (const Frame* X : {&path.start, &path.end}) {
      const Vector3d p = *X * Vector3d(triangle[i].x(), triangle[i].y(), triangle[i].z());
      box += CGAL::Bbox_3(p.x() - path.margin_m, p.y() - path.margin_m, p.z() - path.margin_m,
                          p.x() + path.margin_m, p.y() + path.margin_m, p.z() + path.margin_m);
    }
  return box;
}

/// A traversal of the tool's tree. It visits the nodes and triangles whose box on the path meets a triangle
/// of the obstacle's tree.
class PairTraversal {
 public:
  using Node = CGAL::AABB_node<Traits>;

  PairTraversal(const AabbTree& obstacle, const Triangles& tool_triangles, const Triangles& triangles,
                std::vector<CgalMeshTree::Pair>& pairs)
      : obstacle_(obstacle), tool_triangles_(tool_triangles), triangles_(triangles), pairs_(pairs) {}

  bool go_further() const { return true; }
  bool do_intersect(const Path& path, const Node& node) const {
    return obstacle_.do_intersect(box_around(node.bbox(), path));
  }
  void intersection(const Path& path, const Primitive& primitive) {
    found_.clear();
    obstacle_.all_intersected_primitives(box_around(*primitive.id(), path), std::back_inserter(found_));
    const auto a = static_cast<std::uint32_t>(primitive.id() - tool_triangles_.cbegin());
    for (const auto& id : found_) pairs_.push_back({a, static_cast<std::uint32_t>(id - triangles_.cbegin())});
  }

 private:
  const AabbTree& obstacle_;
  const Triangles& tool_triangles_;
  const Triangles& triangles_;
  std::vector<CgalMeshTree::Pair>& pairs_;
  std::vector<Primitive::Id> found_;
};

}  // namespace

struct CgalMeshTree::Tree {
  Triangles triangles;
  AabbTree tree;
};

CgalMeshTree::CgalMeshTree(const MeshSurface& surface) : surface_(surface) {
  auto tree = std::make_unique<Tree>();
  tree->triangles.reserve(surface.triangles().size());
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t)
    tree->triangles.emplace_back(to_point(surface.corner_m(t, 0)), to_point(surface.corner_m(t, 1)),
                                 to_point(surface.corner_m(t, 2)));
  tree->tree.rebuild(tree->triangles.cbegin(), tree->triangles.cend());
  tree->tree.build();  // otherwise the first query builds it
  tree_ = std::move(tree);
}

CgalMeshTree::~CgalMeshTree() = default;

/// A tree keeps no surface alive. While a tree lives, its users keep the surface alive, so an address in the
/// map is never that of another surface.
std::shared_ptr<const CgalMeshTree> CgalMeshTree::of(const MeshSurface& surface) {
  static std::mutex mutex;
  static std::map<const MeshSurface*, std::weak_ptr<const CgalMeshTree>> trees;
  const std::lock_guard lock(mutex);
  std::erase_if(trees, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<const CgalMeshTree>& shared = trees[&surface];
  if (auto tree = shared.lock()) return tree;
  auto tree = std::make_shared<const CgalMeshTree>(surface);
  shared = tree;
  return tree;
}

void CgalMeshTree::find_pairs(const CgalMeshTree& tool, const Frame& X_BT_start, const Frame& X_BT_end,
                              double margin_m, std::vector<Pair>& pairs) const {
  const Triangles& tool_triangles = tool.tree_->triangles;
  if (tool_triangles.empty() || tree_->triangles.empty()) return;
  const Path path = {X_BT_start, X_BT_end, margin_m};
  if (!CGAL::do_overlap(box_around(tool.tree_->tree.bbox(), path), tree_->tree.bbox())) return;
  PairTraversal traversal(tree_->tree, tool_triangles, tree_->triangles, pairs);
  tool.tree_->tree.traversal(path, traversal);
}

bool CgalMeshTree::contains(const Vector3d& p_m) const {
  // Oblique directions: a segment that meets a vertex or an edge of the mesh does not count; the next one is
  // tried.
  static const std::array<Vector3d, 6> kDirections = {
      Vector3d(0.8626, 0.3919, 0.3199),  Vector3d(-0.3577, 0.8713, 0.3361),
      Vector3d(0.2153, -0.4441, 0.8697), Vector3d(-0.7129, -0.5101, -0.4811),
      Vector3d(0.1013, 0.2371, -0.9661), Vector3d(-0.5519, 0.6067, -0.5723)};
  const CGAL::Bbox_3 box = tree_->tree.bbox();
  const Point p = to_point(p_m);
  if (!CGAL::do_overlap(p.bbox(), box)) return false;
  const double reach_m = 4.0 * (box.xmax() - box.xmin() + box.ymax() - box.ymin() + box.zmax() - box.zmin());
  int count = 0;  // how often the segment leaves the body minus how often it enters
  for (const Vector3d& direction : kDirections) {
    const Point q = to_point(p_m + reach_m * direction);
    std::vector<Primitive::Id> hit;
    tree_->tree.all_intersected_primitives(Kernel::Segment_3(p, q), std::back_inserter(hit));
    count = 0;
    for (const Primitive::Id& id : hit)
      count += CGAL::orientation((*id)[0], (*id)[1], (*id)[2], p) == CGAL::NEGATIVE ? 1 : -1;
    const bool clear = std::none_of(hit.begin(), hit.end(), [&](const Primitive::Id& id) {
      for (int i = 0; i < 3; ++i)
        if (CGAL::orientation(p, q, (*id)[i], (*id)[i + 1]) == CGAL::COPLANAR) return true;
      return false;
    });
    if (clear) break;
  }
  return count > 0;
}

}  // namespace wrenchd
