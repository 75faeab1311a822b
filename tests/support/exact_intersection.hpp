// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

/// Do two meshes have a point in common? Answered by CGAL, in exact arithmetic throughout, and by nothing of
/// ours: the pose's numbers are taken as the fractions that they are, its rotation as q v q* / |q|^2.
class ExactIntersection {
 public:
  /// a moves, b stands still.
  ExactIntersection(const TriangleMesh& a, const TriangleMesh& b);
  ~ExactIntersection();

  bool intersect(const Pose& X_BA) const;
  /// Pairs of triangles that have a point in common.
  std::size_t intersecting_pairs(const Pose& X_BA) const;

 private:
  struct Meshes;
  std::unique_ptr<Meshes> meshes_;
};

}  // namespace wrenchd::test
