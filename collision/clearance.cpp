// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/clearance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <vector>

namespace wrenchd {
namespace {

using Corners = std::array<Vector3d, 3>;

/// Returns the squared distance of a point from a triangle. The nearest point is in the face, on an edge or
/// at a corner, according to the region of the plane that the point projects to.
double squared_distance(const Vector3d& p, const Corners& t) {
  const Vector3d u = t[1] - t[0], v = t[2] - t[0], w = p - t[0];
  const Vector3d n = u.cross(v);
  const double nn = n.squaredNorm();
  if (nn > 0.0) {
    const double beta = u.cross(w).dot(n) / nn, alpha = w.cross(v).dot(n) / nn;
    if (alpha >= 0.0 && beta >= 0.0 && alpha + beta <= 1.0) return std::pow(w.dot(n), 2) / nn;
  }
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d side = t[(i + 1) % 3] - t[i], to = p - t[i];
    const double length = side.squaredNorm();
    const double s = length > 0.0 ? std::clamp(to.dot(side) / length, 0.0, 1.0) : 0.0;
    least = std::min(least, (to - s * side).squaredNorm());
  }
  return least;
}

/// Returns the squared distance of two segments from p along u and from q along v, s and t in [0, 1]. The
/// function of (s, t) is convex: its minimum is where both derivatives vanish, or on the border of the
/// square.
double squared_distance(const Vector3d& p, const Vector3d& u, const Vector3d& q, const Vector3d& v) {
  const Vector3d w = p - q;
  const double a = u.squaredNorm(), b = u.dot(v), c = v.squaredNorm(), d = u.dot(w), e = v.dot(w);
  const auto at = [&](double s, double t) { return (w + s * u - t * v).squaredNorm(); };
  double least = std::numeric_limits<double>::infinity();
  for (const double t : {0.0, 1.0})
    least = std::min(least, at(a > 0.0 ? std::clamp((b * t - d) / a, 0.0, 1.0) : 0.0, t));
  for (const double s : {0.0, 1.0})
    least = std::min(least, at(s, c > 0.0 ? std::clamp((e + b * s) / c, 0.0, 1.0) : 0.0));
  const double det = a * c - b * b;
  if (det <= 0.0) return least;
  const double s = (b * e - c * d) / det, t = (a * e - b * d) / det;
  return s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0 ? std::min(least, at(s, t)) : least;
}

/// A node or a leaf of a BVH, as a sphere about its box.
struct Sphere {
  Vector3d centre_M_m;
  double radius_m;
};

Sphere sphere_of(const TriangleBvh& bvh, const TriangleBvh::Box& box) {
  const Vector3d half(box.half[0], box.half[1], box.half[2]);
  const Vector3d centre_S(box.centre[0], box.centre[1], box.centre[2]);
  return {bvh.R_SM().conjugate() * centre_S, half.norm() + 1e-6 * static_cast<double>(bvh.extent_m())};
}

Corners corners(const MeshBvh& mesh, std::uint32_t triangle) {
  return {mesh.surface.corner_m(triangle, 0), mesh.surface.corner_m(triangle, 1),
          mesh.surface.corner_m(triangle, 2)};
}

/// A pair of boxes and a lower bound of their distance.
struct BoxPair {
  double bound_m;
  std::size_t a, b;  ///< numbers of the boxes

  bool operator<(const BoxPair& other) const { return bound_m > other.bound_m; }  // the least comes first
};

/// The search for the nearest pair of triangles. It opens the pair of boxes with the least bound first, and
/// ends when no bound is below the least distance found.
class NearestPair {
 public:
  NearestPair(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA, double upper_bound_m)
      : a_(a), b_(b), X_BA_(X_BA), least_m_(upper_bound_m) {}

  double search() {
    if (a_.bvh.nodes().empty() || b_.bvh.nodes().empty()) return least_m_;
    push_children(0, 0);
    while (!pairs_.empty() && pairs_.top().bound_m < least_m_) {
      const BoxPair pair = pairs_.top();
      pairs_.pop();
      open(pair);
    }
    return least_m_;
  }

 private:
  static constexpr std::size_t kWidth = TriangleBvh::kWidth;

  void push(std::size_t a, std::size_t b) {
    const TriangleBvh::Box& box_a = a_.bvh.boxes()[a];
    const TriangleBvh::Box& box_b = b_.bvh.boxes()[b];
    if (box_a.count < 0 || box_b.count < 0) return;
    const Sphere sphere_a = sphere_of(a_.bvh, box_a), sphere_b = sphere_of(b_.bvh, box_b);
    const double bound_m =
        (X_BA_ * sphere_a.centre_M_m - sphere_b.centre_M_m).norm() - sphere_a.radius_m - sphere_b.radius_m;
    if (bound_m < least_m_) pairs_.push({bound_m, a, b});
  }
  void push_children(std::size_t node_a, std::size_t node_b) {
    for (std::size_t i = 0; i < kWidth; ++i)
      for (std::size_t k = 0; k < kWidth; ++k) push(kWidth * node_a + i, kWidth * node_b + k);
  }
  void open(const BoxPair& pair) {
    const TriangleBvh::Box& box_a = a_.bvh.boxes()[pair.a];
    const TriangleBvh::Box& box_b = b_.bvh.boxes()[pair.b];
    if (box_a.count > 0 && box_b.count > 0) return compare(box_a, box_b);
    const bool opens_a = box_b.count > 0 || (box_a.count == 0 && box_a.half_area >= box_b.half_area);
    for (std::size_t i = 0; i < kWidth; ++i)
      opens_a ? push(kWidth * box_a.child + i, pair.b) : push(pair.a, kWidth * box_b.child + i);
  }
  void compare(const TriangleBvh::Box& box_a, const TriangleBvh::Box& box_b) {
    const TriangleBvh::Leaf& leaf_a = a_.bvh.leaves()[box_a.child];
    const TriangleBvh::Leaf& leaf_b = b_.bvh.leaves()[box_b.child];
    for (int i = 0; i < box_a.count; ++i) {
      Corners of_a = corners(a_, leaf_a.triangle[i]);
      for (Vector3d& p : of_a) p = X_BA_ * p;
      for (int k = 0; k < box_b.count; ++k)
        least_m_ = std::min(least_m_, triangle_distance_m(of_a, corners(b_, leaf_b.triangle[k])));
    }
  }

  const MeshBvh& a_;
  const MeshBvh& b_;
  Pose X_BA_;
  double least_m_;
  std::priority_queue<BoxPair> pairs_;
};

}  // namespace

double triangle_distance_m(const std::array<Vector3d, 3>& a, const std::array<Vector3d, 3>& b) noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    least = std::min({least, squared_distance(a[i], b), squared_distance(b[i], a)});
    for (std::size_t k = 0; k < 3; ++k)
      least = std::min(least, squared_distance(a[i], a[(i + 1) % 3] - a[i], b[k], b[(k + 1) % 3] - b[k]));
  }
  return std::sqrt(least);
}

double surface_distance_m(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA, double upper_bound_m) {
  return NearestPair(a, b, X_BA, upper_bound_m).search();
}

double clearance_m(const Scene& scene, const Pose& X_WT, double scene_time_s) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const HalfSpaceSettings& half_space : scene.half_spaces())
    for (const Vector3d& p_T : scene.tool().hull.vertices_T_m)
      least_m = std::min(least_m, half_space.normal_W.dot(X_WT * p_T) - half_space.offset_m);
  for (const MeshObstacle& obstacle : scene.meshes())
    least_m = surface_distance_m(*scene.tool_mesh(), *obstacle.mesh,
                                 inverse(obstacle.X_WO_at(scene_time_s)) * X_WT, least_m);
  return least_m;
}

}  // namespace wrenchd
