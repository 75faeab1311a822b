// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/triangle_bvh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Eigenvalues>

#include "core/in_parallel.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kWidth = TriangleBvh::kWidth;
/// Boxes grow by this fraction of the mesh's extent, to contain the rounding to single precision.
constexpr double kRounding = 4e-7;
/// Another choice (axes other than those of the mesh's frame, a split not across the longest axis) is taken
/// if it reduces the cost to this fraction.
constexpr double kWorthwhile = 0.9;
/// Other splits than across the longest axis are tried for at most this number of triangles. More triangles
/// rarely lie in one sheet.
constexpr std::uint32_t kMaxCompared = 4096;
/// Fewer triangles take less time than the start of a thread is worth.
constexpr std::size_t kLeastTrianglesPerThread = 25'000;
/// Traversals enlarge boxes by about this fraction of the mesh's extent.
constexpr double kEnlargement = 1e-4;

/// A box in double precision, and the centroid of the surface in it.
struct Fitted {
  Vector3d centre_m;
  Matrix3d axes;  ///< rows, the longest axis first
  Vector3d half_m;
  Vector3d mean_m;

  double half_area() const noexcept {
    return half_m[0] * half_m[1] + half_m[1] * half_m[2] + half_m[2] * half_m[0];
  }
};

struct Range {
  std::uint32_t begin, end;  ///< in the order of the triangles
};

/// A range divided into two, with the boxes of both parts.
struct Halves {
  Range range;
  std::uint32_t middle;
  Fitted below, above;
};

/// A node of the binary tree from which the nodes with eight boxes are formed.
struct Branch {
  Fitted box;
  std::uint32_t begin, end;   ///< range in the order of the triangles
  std::uint32_t left, right;  ///< children; 0: leaf
};

/// Returns the features that a triangle owns, as in TriangleBvh::Box.
std::uint16_t features_of(const MeshSurface& surface, std::uint32_t triangle) {
  unsigned features = 0;
  const auto add = [&](unsigned kind, unsigned sides) {
    if ((sides & MeshSurface::kFront) != 0) features |= kind;
    if ((sides & MeshSurface::kBack) != 0) features |= kind << TriangleBvh::kBackOfBox;
  };
  const MeshSurface::Features& owned = surface.features()[triangle];
  for (const std::uint32_t vertex : owned.vertices)
    if (vertex != MeshSurface::kNone) add(TriangleBvh::kVertices, surface.sides_of_vertex(vertex));
  for (const std::uint32_t edge : owned.edges)
    if (edge != MeshSurface::kNone) add(TriangleBvh::kEdges, surface.sides_of(surface.convex_edges()[edge]));
  return static_cast<std::uint16_t>(features);
}

/// Adds the features of a box or a triangle to the bits of eight.
void add_features(unsigned features, unsigned lane, std::uint32_t& has_vertices, std::uint32_t& has_edges) {
  const auto bits = [&](unsigned kind) {
    const unsigned front = (features & kind) != 0 ? 1U : 0U;
    const unsigned back = (features >> TriangleBvh::kBackOfBox & kind) != 0 ? 1U : 0U;
    return (front | back << TriangleBvh::kBackOfEight) << lane;
  };
  has_vertices |= bits(TriangleBvh::kVertices);
  has_edges |= bits(TriangleBvh::kEdges);
}

/// Returns the sum of half the surface areas of the bounds of all triangles, along the rows of `axes`.
double bounds_area(const TriangleMesh& mesh, const Matrix3d& axes) {
  double sum = 0.0;
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d a = axes * mesh.vertices_m[i], b = axes * mesh.vertices_m[j],
                   c = axes * mesh.vertices_m[k];
    const Vector3d size = a.cwiseMax(b).cwiseMax(c) - a.cwiseMin(b).cwiseMin(c);
    sum += size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
  }
  return sum;
}

/// For each side of the largest triangle, returns orthonormal rows: the side's direction and the normal last.
std::array<Matrix3d, 3> axes_of_largest_triangle(const TriangleMesh& mesh) {
  std::array<Matrix3d, 3> axes;
  axes.fill(Matrix3d::Identity());
  double largest = 0.0;
  for (const auto& corners : mesh.triangles) {
    std::array<Vector3d, 3> sides;
    for (std::size_t i = 0; i < 3; ++i)
      sides[i] = mesh.vertices_m[corners[(i + 1) % 3]] - mesh.vertices_m[corners[i]];
    const Vector3d area = sides[0].cross(sides[1]);
    if (!(area.squaredNorm() > largest)) continue;
    largest = area.squaredNorm();
    for (std::size_t i = 0; i < 3; ++i) {
      axes[i].row(0) = sides[i].normalized();
      axes[i].row(2) = area.normalized();
      axes[i].row(1) = axes[i].row(2).cross(axes[i].row(0));
    }
  }
  return axes;
}

/// Returns the axes of the covariance of the sides, which weights long sides most.
Matrix3d axes_of_sides(const TriangleMesh& mesh) {
  Matrix3d sum = Matrix3d::Zero();
  for (const auto& corners : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d side = mesh.vertices_m[corners[(i + 1) % 3]] - mesh.vertices_m[corners[i]];
      sum += side * side.transpose();
    }
  Matrix3d axes = Eigen::SelfAdjointEigenSolver<Matrix3d>(sum).eigenvectors().transpose();
  if (axes.determinant() < 0.0) axes.row(2) *= -1.0;
  return axes;
}

Quaterniond best_orientation(const TriangleMesh& mesh) {
  Quaterniond best = Quaterniond::Identity();
  double least = kWorthwhile * bounds_area(mesh, Matrix3d::Identity());
  const auto [first, second, third] = axes_of_largest_triangle(mesh);
  for (const Matrix3d& axes : {first, second, third, axes_of_sides(mesh)}) {
    const double area = bounds_area(mesh, axes);
    if (!(area < least)) continue;
    least = area;
    best = Quaterniond(axes).normalized();
  }
  return best;
}

class Builder {
 public:
  Builder(const MeshSurface& surface, const Quaterniond& R_SM)
      : surface_(surface),
        mesh_(surface.mesh()),
        vertices_S_m_(mesh_.vertices_m),
        order_(mesh_.triangles.size()) {
    const Matrix3d R = R_SM.toRotationMatrix();
    for (Vector3d& p : vertices_S_m_) p = R * p;
    std::iota(order_.begin(), order_.end(), 0U);
    middle_.reserve(order_.size());
    for (std::uint32_t t = 0; t < order_.size(); ++t)
      middle_.push_back((corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3.0);
    for (const Vector3d& p : vertices_S_m_) extent_m_ = std::max(extent_m_, p.lpNorm<Eigen::Infinity>());
    branches_.reserve(order_.size() / 2 + 1);
    split();
  }

  double extent_m() const noexcept { return extent_m_; }
  const std::vector<Branch>& branches() const noexcept { return branches_; }

  TriangleBvh::Leaf leaf(const Branch& branch) const;
  /// Returns the features of all triangles under a branch.
  std::uint16_t features(const Branch& branch) const;

 private:
  const Vector3d& corner(std::uint32_t triangle, std::size_t i) const {
    return vertices_S_m_[mesh_.triangles[triangle][i]];
  }
  Fitted fit(Range range) const;
  Halves halve(Range range, const Fitted& box, int axis);
  Halves best_halves(const Branch& branch);
  double overlap_cost(const Halves& halves) const;
  void split();

  const MeshSurface& surface_;
  const TriangleMesh& mesh_;
  std::vector<Vector3d> vertices_S_m_;
  std::vector<std::uint32_t> order_;
  std::vector<Vector3d> middle_;
  std::vector<Branch> branches_;
  double extent_m_ = 0.0;
};

/// The axes are those of the covariance of the surface. A triangle with corners p, centroid g and area A
/// contributes  A/12 (9 g g' + sum p p').
Fitted Builder::fit(Range range) const {
  const auto [begin, end] = range;
  constexpr double kLeastArea = 1e-30;  // prevents a division by zero
  const Vector3d origin = middle_[order_[begin]];
  double area = 0.0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  for (std::uint32_t k = begin; k < end; ++k) {
    const std::uint32_t t = order_[k];
    const Vector3d a = corner(t, 0) - origin, b = corner(t, 1) - origin, c = corner(t, 2) - origin;
    const double A = 0.5 * (b - a).cross(c - a).norm() + kLeastArea;
    const Vector3d g = middle_[t] - origin;
    area += A;
    first += A * g;
    second +=
        A / 12.0 * (9.0 * g * g.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  const Vector3d mean = first / area;
  Eigen::SelfAdjointEigenSolver<Matrix3d> eigen;
  eigen.computeDirect(second / area - mean * mean.transpose());

  Fitted box;
  box.mean_m = origin + mean;
  box.axes.row(0) = eigen.eigenvectors().col(2).normalized();
  // computeDirect() is fast but its vectors are not exactly orthogonal.
  const Vector3d second_axis = eigen.eigenvectors().col(1);
  box.axes.row(1) =
      (second_axis - box.axes.row(0).dot(second_axis) * box.axes.row(0).transpose()).normalized();
  box.axes.row(2) = box.axes.row(0).cross(box.axes.row(1));
  Vector3d low = Vector3d::Constant(1e300), high = -low;
  for (std::uint32_t k = begin; k < end; ++k)
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d p = box.axes * (corner(order_[k], i) - origin);
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  box.centre_m = origin + box.axes.transpose() * (0.5 * (low + high));
  box.half_m = 0.5 * (high - low);
  return box;
}

/// Splits until each leaf has at most eight triangles. The ranges of one level do not overlap, so that all
/// processors can split them; the branches are the same and in the same order as with one.
void Builder::split() {
  const auto add = [&](const Fitted& box, Range range) {
    branches_.push_back({box, range.begin, range.end, 0, 0});
    return static_cast<std::uint32_t>(branches_.size() - 1);
  };
  const std::size_t threads = threads_for(order_.size(), kLeastTrianglesPerThread);
  const Range all = {0, static_cast<std::uint32_t>(order_.size())};
  add(fit(all), all);
  std::vector<Halves> halves;
  for (std::size_t level = 0; level < branches_.size();) {
    const std::size_t end = branches_.size();
    const auto is_divided = [](const Branch& branch) { return branch.end - branch.begin > kWidth; };
    halves.resize(end - level);
    in_parallel(end - level, threads, [&](std::size_t i) {
      if (is_divided(branches_[level + i])) halves[i] = best_halves(branches_[level + i]);
    });
    for (std::size_t at = level; at < end; ++at) {
      if (!is_divided(branches_[at])) continue;
      const Halves& parts = halves[at - level];
      const std::uint32_t a = add(parts.below, {parts.range.begin, parts.middle}),
                          b = add(parts.above, {parts.middle, parts.range.end});
      branches_[at].left = a;
      branches_[at].right = b;
    }
    level = end;
  }
}

/// Divides across the longest axis, or across the second one if that gives thinner boxes.
Halves Builder::best_halves(const Branch& branch) {
  const Range range = {branch.begin, branch.end};
  const Halves across_longest = halve(range, branch.box, 0);
  if (range.end - range.begin > kMaxCompared) return across_longest;
  const std::vector<std::uint32_t> order(order_.begin() + range.begin, order_.begin() + range.end);
  const Halves across_second = halve(range, branch.box, 1);
  if (overlap_cost(across_second) < kWorthwhile * overlap_cost(across_longest)) return across_second;
  std::copy(order.begin(), order.end(), order_.begin() + range.begin);
  return across_longest;
}

/// Divides the triangles of a range near their mean along an axis of their box, and reorders them.
Halves Builder::halve(Range range, const Fitted& box, int axis) {
  const Vector3d along = box.axes.row(axis);
  const double cut = along.dot(box.mean_m);
  const auto first = order_.begin() + range.begin, last = order_.begin() + range.end;
  const auto position_m = [&](std::uint32_t t) { return along.dot(middle_[t]); };
  const auto below_mean = std::count_if(first, last, [&](std::uint32_t t) { return position_m(t) < cut; });
  // The lower part takes a multiple of eight triangles, so that leaves are full.
  const std::ptrdiff_t eights = std::clamp<std::ptrdiff_t>((below_mean + 4) / 8, 1, (last - first - 1) / 8);
  const auto middle = first + 8 * eights;
  std::nth_element(first, middle, last, [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(position_m(a), a) < std::pair(position_m(b), b);
  });
  const auto at = static_cast<std::uint32_t>(middle - order_.begin());
  return {range, at, fit({range.begin, at}), fit({at, range.end})};
}

/// Returns a measure of how many boxes of another mesh overlap the two boxes, weighted by their triangles. A
/// box of half the size (x, y, z) overlaps a box of half the size (a, b, c) if the two are at most a + x and
/// b + y apart along the surface and c + z across it. The measure assumes square boxes, x = y = sqrt(a b),
/// which makes needles expensive. For z it takes the amount by which traversals enlarge boxes.
double Builder::overlap_cost(const Halves& halves) const {
  const auto cost = [&](const Fitted& box) {
    const double a = box.half_m[0], b = box.half_m[1], side = std::sqrt(a * b);
    return (a + side) * (b + side) * (box.half_m[2] + kEnlargement * extent_m_);
  };
  return (halves.middle - halves.range.begin) * cost(halves.below) +
         (halves.range.end - halves.middle) * cost(halves.above);
}

TriangleBvh::Leaf Builder::leaf(const Branch& branch) const {
  TriangleBvh::Leaf leaf;
  leaf.has_vertices = leaf.has_edges = 0;
  std::fill_n(leaf.bounds_low, 3, 3e38F);
  std::fill_n(leaf.bounds_high, 3, -3e38F);
  for (std::size_t lane = 0; lane < kWidth; ++lane) {
    const bool used = lane < branch.end - branch.begin;
    const std::uint32_t t = order_[used ? branch.begin + lane : branch.begin];
    leaf.triangle[lane] = t;
    if (used)
      add_features(features_of(surface_, t), static_cast<unsigned>(lane), leaf.has_vertices, leaf.has_edges);
    const Vector3d& a = corner(t, 0);
    const Vector3d n = (corner(t, 1) - a).cross(corner(t, 2) - a).normalized();
    for (int d = 0; d < 3; ++d) {
      float low = 3e38F, high = -3e38F;
      for (std::size_t i = 0; i < 3; ++i) {
        const auto x = static_cast<float>(corner(t, i)[d]);
        leaf.corner[i][d][lane] = x;
        low = std::min(low, x);
        high = std::max(high, x);
      }
      leaf.low[d][lane] = used ? low : 3e38F;
      leaf.high[d][lane] = used ? high : -3e38F;
      leaf.normal[d][lane] = static_cast<float>(n[d]);
      leaf.bounds_low[d] = std::min(leaf.bounds_low[d], low);
      leaf.bounds_high[d] = std::max(leaf.bounds_high[d], high);
    }
    leaf.offset[lane] = static_cast<float>(n.dot(a));
  }
  return leaf;
}

std::uint16_t Builder::features(const Branch& branch) const {
  std::uint16_t out = 0;
  constexpr unsigned kAll = (1U << 2 * TriangleBvh::kBackOfBox) - 1;
  for (std::uint32_t k = branch.begin; k < branch.end && out != kAll; ++k)
    out = static_cast<std::uint16_t>(out | features_of(surface_, order_[k]));
  return out;
}

TriangleBvh::Box single(const Fitted& fitted, double rounding_m) {
  TriangleBvh::Box box{};
  for (int d = 0; d < 3; ++d) {
    box.centre[d] = static_cast<float>(fitted.centre_m[d]);
    box.axis[0][d] = static_cast<float>(fitted.axes(0, d));
    box.axis[1][d] = static_cast<float>(fitted.axes(1, d));
    box.half[d] = static_cast<float>(fitted.half_m[d] + rounding_m);
  }
  box.half_area = static_cast<float>(fitted.half_area());
  return box;
}

/// Returns an empty box far away that overlaps nothing.
TriangleBvh::Box nothing() {
  TriangleBvh::Box box{};
  box.centre[0] = box.centre[1] = box.centre[2] = 1e18F;
  box.axis[0][0] = box.axis[1][1] = 1.0F;
  box.count = -1;
  return box;
}

TriangleBvh::Node side_by_side(const TriangleBvh::Box* boxes) {
  TriangleBvh::Node node;
  node.has_vertices = node.has_edges = 0;
  for (std::size_t lane = 0; lane < kWidth; ++lane) {
    const auto& [centre, axis, half, size, child, count, features] = boxes[lane];
    add_features(features, static_cast<unsigned>(lane), node.has_vertices, node.has_edges);
    for (std::size_t d = 0; d < 3; ++d) {
      const std::size_t e = (d + 1) % 3, f = (d + 2) % 3;
      node.centre[d][lane] = centre[d];
      node.half[d][lane] = half[d];
      node.axis[0][d][lane] = axis[0][d];
      node.axis[1][d][lane] = axis[1][d];
      node.axis[2][d][lane] = axis[0][e] * axis[1][f] - axis[0][f] * axis[1][e];
    }
  }
  return node;
}

/// Returns up to eight branches below a branch. Branches with more than eight leaves are opened first. Then
/// every branch that still fits is replaced by its leaves, for few and full nodes.
std::vector<std::uint32_t> opened(const std::vector<Branch>& branches, std::uint32_t top) {
  const auto leaves = [&](std::uint32_t i) {
    return (branches[i].end - branches[i].begin + kWidth - 1) / kWidth;
  };
  std::vector<std::uint32_t> under = {top};
  const auto open = [&](std::size_t i) {
    const Branch& branch = branches[under[i]];
    under[i] = branch.left;
    under.push_back(branch.right);
  };
  const auto most = [&] {
    return static_cast<std::size_t>(
        std::max_element(under.begin(), under.end(),
                         [&](std::uint32_t a, std::uint32_t b) { return leaves(a) < leaves(b); }) -
        under.begin());
  };
  while (under.size() < kWidth && (leaves(under[most()]) > kWidth || under.size() == 1)) {
    if (branches[under[most()]].left == 0) break;
    open(most());
  }
  for (std::size_t i = 0; i < under.size();) {
    const bool fits = under.size() + leaves(under[i]) - 1 <= kWidth;
    if (branches[under[i]].left != 0 && fits)
      open(i);
    else
      ++i;
  }
  return under;
}

}  // namespace

TriangleBvh::TriangleBvh(const MeshSurface& surface) {
  if (surface.triangles().empty()) return;
  const Quaterniond R_SM = best_orientation(surface.mesh());
  R_SM_ = {R_SM.w(), R_SM.x(), R_SM.y(), R_SM.z()};
  const Builder builder(surface, R_SM);
  const std::vector<Branch>& branches = builder.branches();
  extent_m_ = static_cast<float>(builder.extent_m());
  const double rounding_m = kRounding * builder.extent_m();
  std::vector<std::uint32_t> tops = {0};      // branch of each node
  std::vector<std::uint32_t> branch_of_leaf;  // branch of each leaf
  for (std::size_t n = 0; n < tops.size(); ++n) {
    const std::vector<std::uint32_t> under = opened(branches, tops[n]);
    std::array<Box, kWidth> boxes;
    boxes.fill(nothing());
    for (std::size_t i = 0; i < under.size(); ++i) {
      const Branch& branch = branches[under[i]];
      boxes[i] = single(branch.box, rounding_m);
      boxes[i].features = builder.features(branch);
      if (branch.left == 0) {
        boxes[i].child = static_cast<std::uint32_t>(branch_of_leaf.size());
        boxes[i].count = static_cast<std::int16_t>(branch.end - branch.begin);
        branch_of_leaf.push_back(under[i]);
      } else {
        boxes[i].child = static_cast<std::uint32_t>(tops.size());
        tops.push_back(under[i]);
      }
    }
    nodes_.push_back(side_by_side(boxes.data()));
    boxes_.insert(boxes_.end(), boxes.begin(), boxes.end());
  }
  leaves_.resize(branch_of_leaf.size());
  in_parallel(leaves_.size(), threads_for(surface.triangles().size(), kLeastTrianglesPerThread),
              [&](std::size_t i) { leaves_[i] = builder.leaf(branches[branch_of_leaf[i]]); });
}

std::size_t TriangleBvh::bytes() const noexcept {
  return boxes_.size() * sizeof(Box) + nodes_.size() * sizeof(Node) + leaves_.size() * sizeof(Leaf);
}

}  // namespace wrenchd
