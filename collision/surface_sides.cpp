// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/surface_sides.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

namespace wrenchd {
namespace {

/// The point of a triangle nearest to another point, and the part of the triangle in which it lies.
struct NearestPoint {
  enum class Part : std::uint8_t { face, side, corner };
  Vector3d x;
  Part part;
  std::size_t index;  ///< number of the corner, or of the side from that corner to the next one
};

/// The Voronoi regions of the triangle's parts tell in which of them the nearest point lies.
NearestPoint nearest_point(const Vector3d& p, const std::array<Vector3d, 3>& t) noexcept {
  using Part = NearestPoint::Part;
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
  bool inside = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d along = t[(i + 1) % 3] - t[i];
    inside = inside && along.cross(p - t[i]).dot(n) >= 0.0;
  }
  if (inside && n.squaredNorm() > 0.0) return {p - n * (n.dot(p - t[0]) / n.squaredNorm()), Part::face, 0};
  NearestPoint best = {t[0], Part::corner, 0};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d along = t[(i + 1) % 3] - t[i];
    const double length2 = along.squaredNorm(), s = along.dot(p - t[i]);
    NearestPoint here = {t[i], Part::corner, i};
    if (s >= length2)
      here = {t[(i + 1) % 3], Part::corner, (i + 1) % 3};
    else if (s > 0.0)
      here = {t[i] + along * (s / length2), Part::side, i};
    const double distance2 = (p - here.x).squaredNorm();
    if (distance2 < least) least = distance2, best = here;
  }
  return best;
}

/// Returns a lower bound for the squared distance of a point from a box [m^2]. q: in the frame of the BVH.
double squared_distance_bound(const TriangleBvh::Box& box, const Vector3d& q, double rounding_m) noexcept {
  const Vector3d from(q.x() - box.centre[0], q.y() - box.centre[1], q.z() - box.centre[2]);
  const Vector3d x(box.axis[0][0], box.axis[0][1], box.axis[0][2]),
      y(box.axis[1][0], box.axis[1][1], box.axis[1][2]);
  double sum = 0.0;
  const std::array<double, 3> along = {x.dot(from), y.dot(from), x.cross(y).dot(from)};
  for (std::size_t i = 0; i < 3; ++i) {
    const double beyond = std::max(std::abs(along[i]) - static_cast<double>(box.half[i]) - rounding_m, 0.0);
    sum += beyond * beyond;
  }
  return sum;
}

/// The search for the triangle nearest to a point. It opens the nearest box first.
class NearestTriangle {
 public:
  NearestTriangle(const MeshBvh& mesh, const Vector3d& p) noexcept
      : mesh_(mesh),
        p_(p),
        p_S_(mesh.bvh.R_SM() * p),
        rounding_m_(kRounding * (static_cast<double>(mesh.bvh.extent_m()) + p.norm())) {}

  /// Returns false if the stack is too small.
  bool search() noexcept {
    push_children(0);
    while (count_ > 0) {
      const Entry entry = stack_[--count_];
      if (entry.bound_m2 >= least_m2_) continue;
      const TriangleBvh::Box& box = mesh_.bvh.boxes()[entry.box];
      if (box.count > 0)
        test(mesh_.bvh.leaves()[box.child], box.count);
      else if (!push_children(box.child))
        return false;
    }
    return triangle_ != MeshSurface::kNone;
  }
  std::uint32_t triangle() const noexcept { return triangle_; }
  const NearestPoint& point() const noexcept { return point_; }

 private:
  static constexpr double kRounding = 1e-6;  // of single precision, relative to the coordinates
  static constexpr std::size_t kStack = 1024;
  struct Entry {
    double bound_m2;
    std::size_t box;
  };

  bool push_children(std::size_t node) noexcept {
    constexpr std::size_t kWidth = TriangleBvh::kWidth;
    if (count_ + kWidth > kStack) return false;
    const std::size_t first = count_;
    for (std::size_t i = 0; i < kWidth; ++i) {
      const TriangleBvh::Box& box = mesh_.bvh.boxes()[kWidth * node + i];
      if (box.count < 0) continue;
      const double bound_m2 = squared_distance_bound(box, p_S_, rounding_m_);
      if (bound_m2 < least_m2_) stack_[count_++] = {bound_m2, kWidth * node + i};
    }
    std::sort(stack_.begin() + static_cast<std::ptrdiff_t>(first),
              stack_.begin() + static_cast<std::ptrdiff_t>(count_),
              [](const Entry& a, const Entry& b) { return a.bound_m2 > b.bound_m2; });
    return true;
  }
  void test(const TriangleBvh::Leaf& leaf, int count) noexcept {
    for (int i = 0; i < count; ++i) {
      const std::uint32_t t = leaf.triangle[i];
      const MeshSurface& surface = mesh_.surface;
      const NearestPoint here =
          nearest_point(p_, {surface.corner_m(t, 0), surface.corner_m(t, 1), surface.corner_m(t, 2)});
      const double distance_m2 = (p_ - here.x).squaredNorm();
      if (distance_m2 >= least_m2_) continue;
      least_m2_ = distance_m2;
      triangle_ = t;
      point_ = here;
    }
  }

  const MeshBvh& mesh_;
  Vector3d p_, p_S_;
  double rounding_m_;
  double least_m2_ = std::numeric_limits<double>::infinity();
  std::uint32_t triangle_ = MeshSurface::kNone;
  NearestPoint point_ = {};
  std::array<Entry, kStack> stack_;
  std::size_t count_ = 0;
};

/// Returns the sum of the normals of the faces around a corner, each weighted with its angle there. Goes
/// around the vertex from face to face.
Vector3d normal_at_corner(const MeshSurface& surface, std::uint32_t triangle, std::size_t corner) noexcept {
  const std::uint32_t vertex = surface.triangles()[triangle][corner];
  Vector3d sum = Vector3d::Zero();
  std::uint32_t t = triangle;
  for (std::size_t step = 0; step < surface.triangles().size(); ++step) {
    sum += surface.angle_at(t, vertex) * surface.planes()[t].normal;
    const auto& corners = surface.triangles()[t];
    t = surface.neighbour(t, corners[0] == vertex ? 0 : corners[1] == vertex ? 1 : 2);
    if (t == triangle || t == MeshSurface::kNone) break;
  }
  return sum;
}

/// Returns true if all triangles hang together by common vertices.
bool is_in_one_piece(const MeshSurface& surface) {
  std::vector<std::uint32_t> parent(surface.vertices_m().size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& [a, b, c] : surface.triangles()) parent[root(b)] = root(a), parent[root(c)] = root(a);
  return std::all_of(surface.triangles().begin(), surface.triangles().end(), [&](const auto& corners) {
    return root(corners[0]) == root(surface.triangles()[0][0]);
  });
}

}  // namespace

/// core/METHOD.md, section 14.10: the normal at the nearest point tells on which side p is.
unsigned side_of_point(const MeshBvh& mesh, const Vector3d& p) noexcept {
  NearestTriangle nearest(mesh, p);
  if (!nearest.search()) return MeshSurface::kBothSides;
  const MeshSurface& surface = mesh.surface;
  const std::uint32_t t = nearest.triangle();
  const NearestPoint& at = nearest.point();
  Vector3d normal = surface.planes()[t].normal;
  if (at.part == NearestPoint::Part::side) normal += surface.planes()[surface.neighbour(t, at.index)].normal;
  if (at.part == NearestPoint::Part::corner) normal = normal_at_corner(surface, t, at.index);
  const double height = normal.dot(p - at.x);
  if (height > 0.0) return MeshSurface::kFront;
  return height < 0.0 ? MeshSurface::kBack : MeshSurface::kBothSides;
}

SurfaceSides::SurfaceSides(const Scene& scene, bool motion_is_continuous)
    : scene_(scene),
      can_know_(motion_is_continuous &&
                std::any_of(scene.meshes().begin(), scene.meshes().end(),
                            [](const MeshObstacle& obstacle) { return obstacle.mesh->divides_space; }) &&
                is_in_one_piece(scene.tool_mesh()->surface)),
      sides_(scene.meshes().size(), 0) {}

void SurfaceSides::forget() noexcept {
  std::fill(sides_.begin(), sides_.end(), std::uint8_t{0});
  any_known_ = false;
}

unsigned SurfaceSides::of(std::uint32_t number) noexcept {
  const MeshObstacle& obstacle = scene_.meshes()[number];
  if (obstacle.mesh->surface.kind() == MeshSurface::Kind::solid) return MeshSurface::kFront;
  if (!can_know_ || !obstacle.mesh->divides_space) return MeshSurface::kBothSides;
  if (sides_[number] == 0) {
    const Vector3d& p_T = scene_.tool_mesh()->surface.corner_m(0, 0);
    const Vector3d p_O = inverse(obstacle.X_WO_at(time_s_)) * (X_WT_ * p_T);
    sides_[number] = static_cast<std::uint8_t>(side_of_point(*obstacle.mesh, p_O));
    any_known_ = any_known_ || sides_[number] != MeshSurface::kBothSides;
  }
  return sides_[number];
}

}  // namespace wrenchd
