// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

/// Tests whether two meshes have a common point. Uses CGAL with exact arithmetic and no code of wrenchd: the
/// numbers of the pose are exact fractions, and the rotation is q v q* / |q|^2. Pairs that are apart by far
/// more than rounding along a normal are decided in double precision.
class ExactIntersection {
 public:
  /// a: the moving mesh. b: the static mesh.
  ExactIntersection(const TriangleMesh& a, const TriangleMesh& b);
  ~ExactIntersection();

  bool intersect(const Pose& X_BA) const;
  /// Returns the number of triangle pairs that have a common point.
  std::size_t intersecting_pairs(const Pose& X_BA) const;

 private:
  struct Meshes;
  std::unique_ptr<Meshes> meshes_;
};

}  // namespace wrenchd::test
