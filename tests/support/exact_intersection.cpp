// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/exact_intersection.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <vector>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Simple_cartesian.h>

namespace wrenchd::test {
namespace {

using Exact = CGAL::Exact_predicates_exact_constructions_kernel;
using Rough = CGAL::Simple_cartesian<double>;
using RoughTriangles = std::vector<Rough::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Rough, RoughTriangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Rough, Primitive>>;

Exact::Point_3 exact(const Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}

using Corners = std::array<Vector3d, 3>;

Corners corners(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& t) {
  return {mesh.vertices_m[t[0]], mesh.vertices_m[t[1]], mesh.vertices_m[t[2]]};
}

/// Returns true if the triangles are certainly apart, so that faces that touch closely need no exact numbers.
/// They are if their intervals along any direction are apart by more than the rounding of this function and
/// of the pose, some 1e-15 of the coordinates. The directions are the normals, which need not be accurate.
bool certainly_apart(const Corners& a, const Corners& b) {
  for (const Corners& of : {a, b}) {
    const Vector3d n = (of[1] - of[0]).cross(of[2] - of[0]);
    if (!(n.squaredNorm() > 0.0)) continue;
    const Vector3d d = n.normalized();
    double low_a = d.dot(a[0]), high_a = low_a, low_b = d.dot(b[0]), high_b = low_b, extent = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      low_a = std::min(low_a, d.dot(a[k]));
      high_a = std::max(high_a, d.dot(a[k]));
      low_b = std::min(low_b, d.dot(b[k]));
      high_b = std::max(high_b, d.dot(b[k]));
      extent = std::max({extent, a[k].cwiseAbs().maxCoeff(), b[k].cwiseAbs().maxCoeff()});
    }
    if (std::max(low_a - high_b, low_b - high_a) > 1e-13 * (1.0 + extent)) return true;
  }
  return false;
}

}  // namespace

struct ExactIntersection::Meshes {
  TriangleMesh a, b;
  RoughTriangles rough_b;
  std::vector<Exact::Triangle_3> exact_b;
  Tree tree_b;
};

ExactIntersection::ExactIntersection(const TriangleMesh& a, const TriangleMesh& b)
    : meshes_(std::make_unique<Meshes>()) {
  meshes_->a = a;
  meshes_->b = b;
  for (const auto& [i, j, k] : b.triangles) {
    const auto rough = [&](std::uint32_t v) {
      const Vector3d& p = b.vertices_m[v];
      return Rough::Point_3(p.x(), p.y(), p.z());
    };
    meshes_->rough_b.emplace_back(rough(i), rough(j), rough(k));
    meshes_->exact_b.emplace_back(exact(b.vertices_m[i]), exact(b.vertices_m[j]), exact(b.vertices_m[k]));
  }
  meshes_->tree_b.rebuild(meshes_->rough_b.begin(), meshes_->rough_b.end());
  meshes_->tree_b.build();
}

ExactIntersection::~ExactIntersection() = default;

bool ExactIntersection::intersect(const Pose& X_BA) const {
  return intersecting_pairs(X_BA) > 0;
}

/// Enlarged boxes around the triangles select the few pairs for the exact test.
std::size_t ExactIntersection::intersecting_pairs(const Pose& X_BA) const {
  constexpr double kRoom_m = 1e-9;
  const Quaterniond& q = X_BA.rotation;
  const Exact::FT w = q.w(), x = q.x(), y = q.y(), z = q.z();
  const Exact::FT n = w * w + x * x + y * y + z * z;
  const std::array<std::array<Exact::FT, 3>, 3> R = {
      {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
       {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
       {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}}};
  const auto moved = [&](const Vector3d& p) {
    const auto row = [&](std::size_t i) -> Exact::FT {
      return (R[i][0] * p.x() + R[i][1] * p.y() + R[i][2] * p.z()) / n +
             Exact::FT(X_BA.translation_m[static_cast<int>(i)]);
    };
    return Exact::Point_3(row(0), row(1), row(2));
  };
  const auto number = [this](const Primitive::Id& id) {
    return static_cast<std::size_t>(id - meshes_->rough_b.cbegin());
  };
  std::size_t count = 0;
  std::vector<Primitive::Id> near;
  for (const auto& [i, j, k] : meshes_->a.triangles) {
    CGAL::Bbox_3 box;
    for (const std::uint32_t v : {i, j, k}) {
      const Vector3d p = X_BA * meshes_->a.vertices_m[v];
      box += CGAL::Bbox_3(p.x() - kRoom_m, p.y() - kRoom_m, p.z() - kRoom_m, p.x() + kRoom_m, p.y() + kRoom_m,
                          p.z() + kRoom_m);
    }
    near.clear();
    meshes_->tree_b.all_intersected_primitives(box, std::back_inserter(near));
    const Corners of_a = {X_BA * meshes_->a.vertices_m[i], X_BA * meshes_->a.vertices_m[j],
                          X_BA * meshes_->a.vertices_m[k]};
    std::erase_if(near, [&](const Primitive::Id& id) {
      return certainly_apart(of_a, corners(meshes_->b, meshes_->b.triangles[number(id)]));
    });
    if (near.empty()) continue;
    const Exact::Triangle_3 triangle(moved(meshes_->a.vertices_m[i]), moved(meshes_->a.vertices_m[j]),
                                     moved(meshes_->a.vertices_m[k]));
    for (const auto& id : near)
      if (CGAL::do_intersect(triangle, meshes_->exact_b[number(id)])) ++count;
  }
  return count;
}

}  // namespace wrenchd::test
