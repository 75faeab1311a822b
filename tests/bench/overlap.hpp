// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd::bench {

/// A convex polyhedron with the vertices, faces and edges that the separating-axis test needs.
class ConvexSurface {
 public:
  struct Face {
    Vector3d n;  ///< unit outward normal
    double offset_m;
  };
  /// An edge between two faces that are not coplanar.
  struct Edge {
    Vector3d from, to;
    std::array<Vector3d, 2> n;  ///< unit outward normals of the two faces
  };

  /// Precondition: mesh is closed, convex and outward-oriented.
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

/// The shortest translation that separates A from B is depth_m along n.
struct Overlap {
  double depth_m;  ///< penetration depth; if negative, the bodies are apart and only the sign is valid
  Vector3d n;      ///< unit direction from B to A
};

/// Returns the exact translational penetration depth, up to rounding, without iteration and tolerance. The
/// benchmark checks all methods against it; it uses none of wrenchd's queries. Not RT-safe: allocates, and
/// may take seconds for large bodies.
Overlap overlap(const ConvexSurface& A, const ConvexSurface& B);

}  // namespace wrenchd::bench
