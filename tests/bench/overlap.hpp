// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::bench {

/// A convex polyhedron as the test of separating axes wants it.
class ConvexSurface {
 public:
  struct Face {
    Vector3d n;  ///< unit, outward
    double offset_m;
  };
  /// Between two faces that are not in one plane.
  struct Edge {
    Vector3d from, to;
    std::array<Vector3d, 2> n;  ///< of the faces
  };

  /// mesh: closed, convex and outward-oriented.
  explicit ConvexSurface(const TriangleMesh& mesh);

  const std::vector<Vector3d>& vertices() const { return vertices_; }
  const std::vector<Face>& faces() const { return faces_; }
  const std::vector<Edge>& edges() const { return edges_; }

  ConvexSurface transformed(const Pose& X) const;

 private:
  std::vector<Vector3d> vertices_;
  std::vector<Face> faces_;
  std::vector<Edge> edges_;
};

/// The shortest translation that takes A out of B is depth_m along n.
struct Overlap {
  double depth_m;  ///< negative where they are apart, and then no more than a sign
  Vector3d n;      ///< unit, from B to A
};

/// The exact translational penetration depth, to rounding: no iteration and no tolerance. What all others are
/// held against, and nothing of wrenchd's own queries is in it. Slow.
Overlap overlap(const ConvexSurface& A, const ConvexSurface& B);

}  // namespace wrenchd::bench
