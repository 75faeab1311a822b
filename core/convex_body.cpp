// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/convex_body.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include <Eigen/Geometry>

namespace wrenchd {
namespace {

/// Two unit normals that differ by less belong to one plane. Well above the rounding of triangle corners.
constexpr double kSamePlane = 1e-9;

/// Below this ratio of height to length the normal of a triangle is inaccurate, and other vertices may lie
/// above its plane. Bodies with more than kFewVertices compute the support offset only for such triangles.
constexpr double kSliver = 1e-3;
constexpr std::size_t kFewVertices = 4096;

/// Compressed rows: `all` holds the entries of all vertices, row i from begin[i] to begin[i + 1] - 1.
void compress_rows(const std::vector<std::vector<std::uint32_t>>& at, std::vector<std::uint32_t>& begin,
                   std::vector<std::uint32_t>& all) {
  begin.clear();
  all.clear();
  for (const auto& of_vertex : at) {
    begin.push_back(static_cast<std::uint32_t>(all.size()));
    all.insert(all.end(), of_vertex.begin(), of_vertex.end());
  }
  begin.push_back(static_cast<std::uint32_t>(all.size()));
}

}  // namespace

void ConvexBody::compute_derived_data() {
  order_.resize(vertices_T_m.size());
  std::iota(order_.begin(), order_.end(), 0u);
  blocks_.clear();
  build_blocks(0, static_cast<std::uint32_t>(order_.size()));
  ordered_m_.clear();
  for (const std::uint32_t v : order_) ordered_m_.push_back(vertices_T_m[v]);

  faces.clear();
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& p : vertices_T_m) middle += p / static_cast<double>(vertices_T_m.size());
  std::vector<std::vector<std::uint32_t>> at(vertices_T_m.size());

  const bool is_small = vertices_T_m.size() <= kFewVertices;
  const auto find_face = [&](const Vector3d& n, std::uint32_t vertex) {
    for (const std::uint32_t f : at[vertex])
      if ((faces[f].n - n).norm() < kSamePlane) return static_cast<std::int64_t>(f);
    return std::int64_t{-1};
  };
  const auto add = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const Vector3d& p = vertices_T_m[i];
    Vector3d n = (vertices_T_m[j] - p).cross(vertices_T_m[k] - p);
    if (!(n.squaredNorm() > 0.0)) return;  // degenerate triangle without a plane
    const bool sliver = n.norm() < kSliver * (vertices_T_m[j] - vertices_T_m[k]).squaredNorm() ||
                        n.norm() < kSliver * (vertices_T_m[j] - p).squaredNorm();
    n.normalize();
    if (n.dot(p - middle) < 0.0) n = -n;
    std::int64_t face = find_face(n, i);
    if (face < 0) face = find_face(n, j);
    if (face < 0) face = find_face(n, k);
    if (face < 0) {
      face = static_cast<std::int64_t>(faces.size());
      faces.push_back({n, n.dot(vertices_T_m[sliver || is_small ? support(n, i) : i])});
    }
    const auto f = static_cast<std::uint32_t>(face);
    for (const std::uint32_t v : {i, j, k})
      if (std::find(at[v].begin(), at[v].end(), f) == at[v].end()) at[v].push_back(f);
  };
  for (std::uint32_t v = 0; v < vertices_T_m.size(); ++v) {
    const auto around = ring_of(v);
    for (std::size_t i = 0; i < around.size(); ++i) {
      const std::uint32_t a = around[i];
      const std::uint32_t b = around[(i + 1) % around.size()];
      if (v < a && v < b) add(v, a, b);
    }
  }

  compress_rows(at, faces_begin, faces_at);

  edges.clear();
  for (std::uint32_t v = 0; v < vertices_T_m.size(); ++v)
    for (const std::uint32_t w : ring_of(v))
      if (v < w) add_edge(v, w, at[v], at[w]);
  at.assign(vertices_T_m.size(), {});
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    at[edges[e].from].push_back(e);
    at[edges[e].to].push_back(e);
  }
  compress_rows(at, edges_begin, edges_at);
}

/// Adds the edge if it separates two faces. An edge inside a flat face has only one face and is skipped.
void ConvexBody::add_edge(std::uint32_t from, std::uint32_t to, std::span<const std::uint32_t> faces_from,
                          std::span<const std::uint32_t> faces_to) {
  std::vector<std::uint32_t> both;
  for (const std::uint32_t f : faces_from)
    if (std::find(faces_to.begin(), faces_to.end(), f) != faces_to.end()) both.push_back(f);
  if (both.size() < 2) return;
  const Vector3d d = (vertices_T_m[to] - vertices_T_m[from]).normalized();
  const auto towards = [&](const Vector3d& n, const Vector3d& other) -> Vector3d {
    const Vector3d t = d.cross(n);
    return t.dot(other) < 0.0 ? Vector3d(-t) : t;
  };
  const Vector3d& n0 = faces[both[0]].n;
  const Vector3d& n1 = faces[both[1]].n;
  edges.push_back({from, to, d, {towards(n0, n1), towards(n1, n0)}});
}

/// Halves the vertices along the longest side of their box until at most kFew remain. Above kMany vertices it
/// also adds an inner node that can skip the whole subtree.
void ConvexBody::build_blocks(std::uint32_t begin, std::uint32_t end) {
  constexpr std::uint32_t kFew = 16, kMany = 256;
  Eigen::AlignedBox3d extent;
  for (std::uint32_t i = begin; i < end; ++i) extent.extend(vertices_T_m[order_[i]]);
  const bool is_small = end - begin <= kFew;
  const std::size_t here = blocks_.size();
  if (is_small || end - begin > kMany) {
    Block block{extent.center(), 0.0, begin, is_small ? end : begin, static_cast<std::uint32_t>(here + 1)};
    for (std::uint32_t i = begin; i < end; ++i)
      block.radius_m = std::max(block.radius_m, (vertices_T_m[order_[i]] - block.centre_m).norm());
    // covers the rounding of the radius and of the dot products in visit_above()
    block.radius_m *= 1.0 + 1e-12;
    blocks_.push_back(block);
  }
  if (!is_small) {
    Eigen::Index axis = 0;
    extent.sizes().maxCoeff(&axis);
    const std::uint32_t middle = begin + (end - begin) / 2;
    const auto before = [&](std::uint32_t x, std::uint32_t y) {
      return vertices_T_m[x][axis] < vertices_T_m[y][axis];
    };
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end, before);
    build_blocks(begin, middle);
    build_blocks(middle, end);
    if (end - begin > kMany) blocks_[here].skip_to = static_cast<std::uint32_t>(blocks_.size());
  }
}

// A local climb from neighbour to neighbour would visit fewer vertices but is not reliable. On faces whose
// triangles are coplanar up to rounding, all neighbours of a vertex may appear level. The climb would stop
// far below the true support, and the projection would accept an overlapping pose. This search skips a node
// only if none of its vertices can be the support.
std::uint32_t ConvexBody::support(const Vector3d& direction, std::uint32_t near) const noexcept {
  std::uint32_t best = near;
  double height = direction.dot(vertices_T_m[near]);
  visit_above(
      direction, [&] { return height; },
      [&](std::uint32_t v, double h) {
        if (h <= height) return;
        height = h;
        best = v;
      });
  return best;
}

std::uint32_t ConvexBody::support(const Vector3d& direction) const noexcept {
  // Start with the leaf that reaches farthest: it skips most of the other nodes.
  const double length = direction.norm();
  const auto reach = [&](const Block& block) {
    return direction.dot(block.centre_m) + length * block.radius_m;
  };
  const auto highest = std::max_element(blocks_.begin(), blocks_.end(), [&](const Block& x, const Block& y) {
    const bool x_empty = x.begin == x.end, y_empty = y.begin == y.end;
    return x_empty != y_empty ? x_empty : reach(x) < reach(y);
  });
  return support(direction, order_[highest->begin]);
}

}  // namespace wrenchd
