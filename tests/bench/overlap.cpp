// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/overlap.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace wrenchd::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Faces and edges whose directions differ by less than this angle [rad] create no edge and no axis.
constexpr double kParallel = 1e-9;

double lowest(const std::vector<Vector3d>& points, const Vector3d& n) {
  double low = kInfinity;
  for (const Vector3d& p : points) low = std::min(low, n.dot(p));
  return low;
}

/// Returns true if m lies on the arc between the normals of the edge's two faces. A plane along the edge with
/// outward normal m then supports the body at this edge.
bool on_arc(const ConvexSurface::Edge& edge, const Vector3d& m) {
  const Vector3d across = edge.n[0].cross(edge.n[1]);
  return edge.n[0].cross(m).dot(across) >= 0.0 && m.cross(edge.n[1]).dot(across) >= 0.0;
}

/// Returns the edges that reach below a height along n.
std::vector<const ConvexSurface::Edge*> edges_below(const ConvexSurface& body, const Vector3d& n,
                                                    double height) {
  std::vector<const ConvexSurface::Edge*> below;
  for (const ConvexSurface::Edge& edge : body.edges())
    if (std::min(n.dot(edge.from), n.dot(edge.to)) <= height) below.push_back(&edge);
  return below;
}

Overlap least_by_faces(const ConvexSurface& A, const ConvexSurface& B) {
  Overlap least{kInfinity, Vector3d::UnitZ()};
  for (const auto& face : B.faces())
    if (const double depth = face.offset_m - lowest(A.vertices(), face.n); depth < least.depth_m)
      least = {depth, face.n};
  for (const auto& face : A.faces())
    if (const double depth = face.offset_m - lowest(B.vertices(), face.n); depth < least.depth_m)
      least = {depth, -face.n};
  return least;
}

}  // namespace

ConvexSurface::ConvexSurface(const TriangleMesh& mesh) : vertices_(mesh.vertices_m) {
  // Normal of the triangle to the left of each directed edge.
  std::map<std::pair<std::uint32_t, std::uint32_t>, Vector3d> normal_at;
  for (const auto& t : mesh.triangles) {
    const Vector3d& a = vertices_[t[0]];
    const Vector3d n = (vertices_[t[1]] - a).cross(vertices_[t[2]] - a).normalized();
    faces_.push_back({n, -lowest(vertices_, -n)});
    for (std::size_t i = 0; i < 3; ++i) normal_at[{t[i], t[(i + 1) % 3]}] = n;
  }
  for (const auto& [ends, n] : normal_at) {
    if (ends.first > ends.second) continue;
    const Vector3d& other = normal_at.at({ends.second, ends.first});
    if (n.cross(other).norm() < kParallel) continue;
    edges_.push_back({vertices_[ends.first], vertices_[ends.second], {n, other}});
  }
}

ConvexSurface ConvexSurface::transformed(const Pose& X) const {
  ConvexSurface out = *this;
  const Matrix3d R = X.rotation.toRotationMatrix();
  for (Vector3d& p : out.vertices_) p = R * p + X.translation_m;
  for (Face& face : out.faces_) {
    face.n = R * face.n;
    face.offset_m += face.n.dot(X.translation_m);
  }
  for (Edge& edge : out.edges_) {
    edge.from = R * edge.from + X.translation_m;
    edge.to = R * edge.to + X.translation_m;
    for (Vector3d& n : edge.n) n = R * n;
  }
  return out;
}

// The depth is the distance from the origin to the nearest facet of the set of colliding translations. A
// facet is either a face of one body with a vertex of the other, or two edges whose normal arcs cross. The
// function tests the faces first. Let d0 be the smallest depth of the faces, along n0. Edges with a smaller
// depth d < d0 touch after a translation by d, so a point a of one edge is d away from a point b of the
// other; then
//
//   n0 . a <= n0 . b + d <= top of B + d = bottom of A + d0 + d        and the same for b
//
// Therefore only the few edges within 2 d0 of the bottom of A and of the top of B form pairs.
Overlap overlap(const ConvexSurface& A, const ConvexSurface& B) {
  Overlap least = least_by_faces(A, B);
  if (least.depth_m <= 0.0) return least;
  const Vector3d n0 = least.n;
  const double reach = 2.0 * least.depth_m;
  const auto of_A = edges_below(A, n0, lowest(A.vertices(), n0) + reach);
  const auto of_B = edges_below(B, -n0, lowest(B.vertices(), -n0) + reach);
  for (const auto* a : of_A) {
    const Vector3d along = (a->to - a->from).normalized();
    for (const auto* b : of_B) {
      const Vector3d N = along.cross((b->to - b->from).normalized());
      if (N.norm() < kParallel) continue;
      for (const double sign : {1.0, -1.0}) {
        const Vector3d n = sign * N.normalized();
        if (!on_arc(*b, n) || !on_arc(*a, -n)) continue;
        const double depth = n.dot(b->from - a->from);
        if (depth < least.depth_m) least = {depth, n};
      }
    }
  }
  return least;
}

}  // namespace wrenchd::bench
