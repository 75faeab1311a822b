// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/flat_regions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>

namespace wrenchd {
namespace {

constexpr std::uint32_t kNoRegion = HalfEdgeMesh::kNone;

/// The plane that fits a growing set of points best: the eigenvector of the smallest eigenvalue of their
/// covariance.
class PlaneFit {
 public:
  explicit PlaneFit(const Vector3d& origin_m) : origin_m_(origin_m) {}

  void add(const Vector3d& p_m) {
    const Vector3d p = p_m - origin_m_;
    sum_ += p;
    squares_ += p * p.transpose();
    ++count_;
  }
  std::size_t count() const { return count_; }

  /// Returns the plane with its normal on the side of `outward`.
  FlatRegions::Plane plane(const Vector3d& outward) const {
    const Vector3d mean = sum_ / static_cast<double>(count_);
    const Matrix3d covariance = squares_ / static_cast<double>(count_) - mean * mean.transpose();
    Vector3d normal = Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance).eigenvectors().col(0);
    if (normal.dot(outward) < 0.0) normal = -normal;
    return {normal, normal.dot(origin_m_ + mean)};
  }

 private:
  Vector3d origin_m_;
  Vector3d sum_ = Vector3d::Zero();
  Matrix3d squares_ = Matrix3d::Zero();
  std::size_t count_ = 0;
};

class RegionGrowth {
 public:
  RegionGrowth(const HalfEdgeMesh& mesh, double tolerance_m)
      : mesh_(mesh),
        tolerance_m_(tolerance_m),
        area_normals_(mesh.face_count()),
        visit_(mesh.face_count(), 0) {
    regions_.region_of_face.assign(mesh.face_count(), kNoRegion);
    for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
      area_normals_[f] = (corner(f, 1) - corner(f, 0)).cross(corner(f, 2) - corner(f, 0));
  }

  FlatRegions find() {
    std::vector<double> areas(mesh_.face_count());
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f) areas[f] = area_normals_[f].norm();
    std::vector<std::uint32_t> largest_first(mesh_.face_count());
    std::iota(largest_first.begin(), largest_first.end(), 0U);
    std::stable_sort(largest_first.begin(), largest_first.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return areas[a] > areas[b]; });
    for (const std::uint32_t seed : largest_first)
      if (regions_.region_of_face[seed] == kNoRegion) add_region(seed);
    return std::move(regions_);
  }

 private:
  Vector3d corner(std::uint32_t f, std::size_t i) const { return mesh_.vertex_m(mesh_.corners(f)[i]); }

  /// The noise of the seed's corners tilts its own plane. So the region grows twice: first while the plane is
  /// fitted again whenever the number of faces has doubled, then from the seed with the plane so found.
  void add_region(std::uint32_t seed) {
    const Vector3d outward = area_normals_[seed].normalized();
    FlatRegions::Plane plane = {outward, outward.dot(corner(seed, 0))};
    PlaneFit fit(corner(seed, 0));
    std::size_t next_fit = 2;
    grow(seed, plane, [&](std::uint32_t f) {
      for (std::size_t i = 0; i < 3; ++i) fit.add(corner(f, i));
      if (fit.count() < 3 * next_fit) return;
      plane = fit.plane(outward);
      next_fit *= 2;
    });
    if (fit.count() > 3) plane = fit.plane(outward);
    const auto number = static_cast<std::uint32_t>(regions_.planes.size());
    double highest_m = -std::numeric_limits<double>::infinity(), area_m2 = 0.0;
    grow(seed, plane, [&](std::uint32_t f) {
      regions_.region_of_face[f] = number;
      area_m2 += 0.5 * area_normals_[f].norm();
      for (std::size_t i = 0; i < 3; ++i) highest_m = std::max(highest_m, plane.normal.dot(corner(f, i)));
    });
    plane.offset_m = highest_m;
    regions_.planes.push_back(plane);
    regions_.areas_m2.push_back(area_m2);
  }

  /// Calls use(face) for the seed and for each connected free face in the plane. use() may change the plane.
  template <class Use>
  void grow(std::uint32_t seed, const FlatRegions::Plane& plane, const Use& use) {
    ++visits_;
    visit_[seed] = visits_;
    front_.assign(1, seed);
    for (std::size_t next = 0; next < front_.size(); ++next) {
      const std::uint32_t f = front_[next];
      use(f);
      for (std::uint32_t h = 3 * f; h < 3 * f + 3; ++h) {
        const std::uint32_t other = HalfEdgeMesh::face_of(mesh_.twin(h));
        if (visit_[other] == visits_ || regions_.region_of_face[other] != kNoRegion || !lies_in(plane, other))
          continue;
        visit_[other] = visits_;
        front_.push_back(other);
      }
    }
  }

  bool lies_in(const FlatRegions::Plane& plane, std::uint32_t f) const {
    for (std::size_t i = 0; i < 3; ++i)
      if (!(std::abs(plane.normal.dot(corner(f, i)) - plane.offset_m) <= tolerance_m_)) return false;
    // Noise may turn a needle over.
    const double facing = plane.normal.dot(area_normals_[f]), area = area_normals_[f].norm();
    return facing > 0.5 * area || area <= 4.0 * tolerance_m_ * longest_side_m(f);
  }

  double longest_side_m(std::uint32_t f) const {
    return std::max({(corner(f, 1) - corner(f, 0)).norm(), (corner(f, 2) - corner(f, 1)).norm(),
                     (corner(f, 0) - corner(f, 2)).norm()});
  }

  const HalfEdgeMesh& mesh_;
  double tolerance_m_;
  std::vector<Vector3d> area_normals_;
  std::vector<std::uint32_t> visit_;  ///< for each face: number of the growth that reached it last
  std::uint32_t visits_ = 0;
  std::vector<std::uint32_t> front_;
  FlatRegions regions_;
};

}  // namespace

FlatRegions find_flat_regions(const HalfEdgeMesh& mesh, double tolerance_m) {
  return RegionGrowth(mesh, tolerance_m).find();
}

}  // namespace wrenchd
