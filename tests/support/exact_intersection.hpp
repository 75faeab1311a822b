// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

/// Do two meshes have a point in common? Answered by CGAL, in exact arithmetic throughout, and by nothing of
/// ours: the pose's numbers are taken as the fractions that they are, its rotation as q v q* / |q|^2.
class ExactMeeting {
 public:
  /// a moves, b stands still.
  ExactMeeting(const TriangleMesh& a, const TriangleMesh& b);
  ~ExactMeeting();

  bool meet(const Pose& X_BA) const;
  /// Pairs of triangles that have a point in common.
  std::size_t pairs(const Pose& X_BA) const;

 private:
  struct Meshes;
  std::unique_ptr<Meshes> meshes_;
};

}  // namespace wrenchd::test
