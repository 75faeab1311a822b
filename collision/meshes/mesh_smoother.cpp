// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_smoother.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

namespace wrenchd {
namespace {

using Index = std::uint32_t;

/// Largest distance between the smooth surface and the triangles that follow it, if the permitted number of
/// triangles suffices [m].
constexpr double kDeviation_m = 0.1e-6;
/// Factor by which the deviation grows until the triangles are few enough.
constexpr double kCoarser = 1.3;
/// Largest number of parts of an edge.
constexpr Index kMaxParts = 24;
/// Two creases at a vertex are one curve if they turn by less than this angle [rad].
constexpr double kCurveAngle_rad = 1.0;

/// An edge of the mesh as a cubic curve, from the vertex with the smaller number to the other one.
struct Edge {
  Index a = 0, b = 0;
  std::array<Index, 2> half_edges{};  ///< 3 face + corner at which each of its faces begins it; the first two
  Index faces = 0;                    ///< number of its faces
  bool smooth = false;
  Vector3d control_a_m = Vector3d::Zero(), control_b_m = Vector3d::Zero();
  double height_m = 0.0;  ///< largest distance of the curve from the straight edge [m]
  Index parts = 1;
  Index first_point = 0;  ///< number of its first inner point in the result
};

/// Returns the point of a cubic curve at t, 0 to 1.
Vector3d on_curve(const Vector3d& a, const Edge& edge, const Vector3d& b, double t) {
  const double s = 1.0 - t;
  return s * s * s * a + 3.0 * s * s * t * edge.control_a_m + 3.0 * s * t * t * edge.control_b_m +
         t * t * t * b;
}

class MeshSmoother {
 public:
  MeshSmoother(const TriangleMesh& mesh, const Smoothing& smoothing)
      : mesh_(mesh), most_m_(smoothing.most_m) {
    find_edges();
    find_normals();
    find_curves();
    choose_parts(smoothing.max_triangles);
  }

  SimplifiedMesh run() {
    out_.mesh.vertices_m = mesh_.vertices_m;
    out_.source_vertex.resize(mesh_.vertices_m.size());
    std::iota(out_.source_vertex.begin(), out_.source_vertex.end(), 0);
    for (Edge& edge : edges_) divide(edge);
    for (Index face = 0; face < mesh_.triangles.size(); ++face) fill(face);
    return std::move(out_);
  }

 private:
  const Vector3d& vertex(Index v) const { return mesh_.vertices_m[v]; }
  Index corner(Index half_edge) const { return mesh_.triangles[half_edge / 3][half_edge % 3]; }
  static Index next(Index half_edge) { return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1; }
  Vector3d face_normal(Index face) const {
    const auto& [a, b, c] = mesh_.triangles[face];
    return (vertex(b) - vertex(a)).cross(vertex(c) - vertex(a)).normalized();
  }

  void find_edges() {
    const auto half_edges = static_cast<Index>(3 * mesh_.triangles.size());
    std::vector<std::pair<std::uint64_t, Index>> keys;
    keys.reserve(half_edges);
    for (Index h = 0; h < half_edges; ++h) {
      const std::uint64_t a = corner(h), b = corner(next(h));
      keys.emplace_back(std::min(a, b) << 32 | std::max(a, b), h);
    }
    std::sort(keys.begin(), keys.end());
    edge_of_.resize(half_edges);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (i == 0 || keys[i].first != keys[i - 1].first) {
        Edge edge;
        edge.a = static_cast<Index>(keys[i].first >> 32);
        edge.b = static_cast<Index>(keys[i].first & 0xffffffffU);
        edges_.push_back(edge);
      }
      Edge& edge = edges_.back();
      if (edge.faces < 2) edge.half_edges[edge.faces] = keys[i].second;
      ++edge.faces;
      edge_of_[keys[i].second] = static_cast<Index>(edges_.size() - 1);
    }
    for (Edge& edge : edges_) {
      const auto& [h, g] = edge.half_edges;
      edge.smooth = edge.faces == 2 && corner(h) != corner(g) &&
                    face_normal(h / 3).dot(face_normal(g / 3)) > std::cos(kCreaseAngle_rad);
    }
  }

  /// Computes the normals. The corners of a vertex between two creases share one: core/METHOD.md, section
  /// 14.11.
  void find_normals() {
    group_.resize(edge_of_.size());
    std::iota(group_.begin(), group_.end(), 0);
    for (const Edge& edge : edges_) {
      if (!edge.smooth) continue;
      const auto& [h, g] = edge.half_edges;
      unite(h, next(g));
      unite(next(h), g);
    }
    normals_.assign(edge_of_.size(), Vector3d::Zero());
    for (Index h = 0; h < edge_of_.size(); ++h) {
      const Vector3d to_next = vertex(corner(next(h))) - vertex(corner(h));
      const Vector3d to_previous = vertex(corner(next(next(h)))) - vertex(corner(h));
      normals_[root(h)] += to_next.cross(to_previous) / (to_next.squaredNorm() * to_previous.squaredNorm());
    }
    for (Vector3d& n : normals_)
      if (n.squaredNorm() > 0.0) n.normalize();
  }
  Index root(Index corner) {
    while (group_[corner] != corner) corner = group_[corner] = group_[group_[corner]];
    return corner;
  }
  void unite(Index a, Index b) { group_[root(a)] = root(b); }
  const Vector3d& normal(Index corner) { return normals_[root(corner)]; }

  void find_curves() {
    find_crease_neighbours();
    for (Edge& edge : edges_) {
      const Vector3d &a = vertex(edge.a), &b = vertex(edge.b), chord = b - a;
      if (edge.smooth) {
        Index at_a = edge.half_edges[0], at_b = next(at_a);
        if (corner(at_a) != edge.a) std::swap(at_a, at_b);
        const Vector3d n_a = normal(at_a), n_b = normal(at_b);
        edge.control_a_m = a + (chord - chord.dot(n_a) * n_a) / 3.0;
        edge.control_b_m = b - (chord - chord.dot(n_b) * n_b) / 3.0;
      } else {
        edge.control_a_m = a + tangent(edge.a, chord) / 3.0;
        edge.control_b_m = b - tangent(edge.b, chord) / 3.0;
      }
      flatten(edge, chord);
    }
  }

  /// Finds two neighbours of each vertex along creases, and counts them.
  void find_crease_neighbours() {
    constexpr Index kNoOther = ~Index{0};
    creases_.assign(mesh_.vertices_m.size(), {kNoOther, kNoOther, 0});
    for (const Edge& edge : edges_) {
      if (edge.smooth) continue;
      for (const auto& [v, other] : {std::pair(edge.a, edge.b), std::pair(edge.b, edge.a)}) {
        auto& crease = creases_[v];
        if (crease[2] < 2) crease[crease[2]] = other;
        ++crease[2];
      }
    }
  }

  /// Returns the projection of the chord on the tangent of the crease curve at vertex v: the tangent of the
  /// circle through v and its two neighbours. Returns the chord itself at an end or a corner of the curve.
  Vector3d tangent(Index v, const Vector3d& chord) const {
    const auto& [first, second, count] = creases_[v];
    if (count != 2) return chord;
    const Vector3d in = vertex(v) - vertex(first), out = vertex(second) - vertex(v);
    const double l_in = in.norm(), l_out = out.norm();
    if (in.dot(out) < std::cos(kCurveAngle_rad) * l_in * l_out) return chord;
    const Vector3d t = (l_out * (in / l_in) + l_in * (out / l_out)).normalized();
    return chord.dot(t) * t;
  }

  /// Reduces the height of a curve to the permitted one.
  void flatten(Edge& edge, const Vector3d& chord) const {
    const Vector3d third_a = vertex(edge.a) + chord / 3.0, third_b = vertex(edge.b) - chord / 3.0;
    const Vector3d d_a = edge.control_a_m - third_a, d_b = edge.control_b_m - third_b;
    const double height_m = 0.75 * std::max(d_a.norm(), d_b.norm());
    const double share = height_m > most_m_ ? most_m_ / height_m : 1.0;
    edge.control_a_m = third_a + share * d_a;
    edge.control_b_m = third_b + share * d_b;
    edge.height_m = share * height_m;
  }

  /// Chooses the number of parts of each edge. A curve of n parts deviates from its polygon by its height
  /// divided by n^2.
  void choose_parts(std::size_t max_triangles) {
    for (double deviation_m = kDeviation_m;; deviation_m *= kCoarser) {
      for (Edge& edge : edges_)
        edge.parts = std::clamp(static_cast<Index>(std::ceil(std::sqrt(edge.height_m / deviation_m))),
                                Index{1}, kMaxParts);
      std::size_t triangles = 0;
      bool divided = false;
      for (Index face = 0; face < mesh_.triangles.size(); ++face) {
        const std::size_t m = most_parts(face);
        triangles += m * m;
        divided = divided || m > 1;
      }
      if (triangles <= max_triangles || !divided) return;
    }
  }
  Index most_parts(Index face) const {
    return std::max({edges_[edge_of_[3 * face]].parts, edges_[edge_of_[3 * face + 1]].parts,
                     edges_[edge_of_[3 * face + 2]].parts});
  }

  Index add_point(const Vector3d& p_m, Index source) {
    out_.mesh.vertices_m.push_back(p_m);
    out_.source_vertex.push_back(source);
    return static_cast<Index>(out_.mesh.vertices_m.size() - 1);
  }
  void add_triangle(Index a, Index b, Index c, Index face) {
    out_.mesh.triangles.push_back({a, b, c});
    out_.source_triangle.push_back(face);
  }
  /// flat_m: the point of the triangle or edge that p_m replaces.
  void measure(const Vector3d& p_m, const Vector3d& flat_m) {
    out_.distance_m = std::max(out_.distance_m, (p_m - flat_m).norm());
  }

  void divide(Edge& edge) {
    const Vector3d &a = vertex(edge.a), &b = vertex(edge.b);
    edge.first_point = static_cast<Index>(out_.mesh.vertices_m.size());
    for (Index i = 1; i < edge.parts; ++i) {
      const double t = static_cast<double>(i) / edge.parts;
      const Vector3d p_m = on_curve(a, edge, b, t);
      const Vector3d flat_m = a + (p_m - a).dot(b - a) / (b - a).squaredNorm() * (b - a);
      measure(p_m, flat_m);
      add_point(p_m, t <= 0.5 ? edge.a : edge.b);
    }
  }

  /// Returns the points of a side of a face, in the direction of its half-edge, both ends included.
  std::vector<Index> side(Index half_edge) const {
    const Edge& edge = edges_[edge_of_[half_edge]];
    const bool forward = corner(half_edge) == edge.a;
    std::vector<Index> points = {corner(half_edge)};
    for (Index i = 0; i + 1 < edge.parts; ++i)
      points.push_back(edge.first_point + (forward ? i : edge.parts - 2 - i));
    points.push_back(corner(next(half_edge)));
    return points;
  }

  void fill(Index face) {
    const std::array<std::vector<Index>, 3> sides = {side(3 * face), side(3 * face + 1), side(3 * face + 2)};
    const Index m = most_parts(face);
    if (m == 1) return add_triangle(sides[0][0], sides[1][0], sides[2][0], face);
    if (m == 2) return fill_halves(sides, face);
    fill_grid(sides, m, face);
  }

  /// Fills a face whose sides have one or two parts.
  void fill_halves(const std::array<std::vector<Index>, 3>& sides, Index face) {
    if (sides[0].size() == 3 && sides[1].size() == 3 && sides[2].size() == 3) {
      for (std::size_t i = 0; i < 3; ++i) add_triangle(sides[i][0], sides[i][1], sides[(i + 2) % 3][1], face);
      return add_triangle(sides[0][1], sides[1][1], sides[2][1], face);
    }
    std::size_t first = 0;  // a side with a middle, from which all other points are in sight
    while (sides[first].size() == 2) ++first;
    std::vector<Index> around = {sides[first][2]};
    for (const std::size_t k : {(first + 1) % 3, (first + 2) % 3})
      around.insert(around.end(), sides[k].begin() + 1, sides[k].end());
    for (std::size_t i = 0; i + 1 < around.size(); ++i)
      add_triangle(sides[first][1], around[i], around[i + 1], face);
  }

  /// Fills a face with a grid of m parts, and joins the grid with the points of the sides.
  void fill_grid(const std::array<std::vector<Index>, 3>& sides, Index m, Index face) {
    const Patch patch = patch_of(face);
    const Index rows = m - 2;  // inner points along each side of the grid
    std::vector<Index> grid;
    grid.reserve(rows * (rows + 1) / 2);
    for (Index i = 0; i < rows; ++i)  // weight of corner 0 falls
      for (Index j = 0; j <= i; ++j)  // weight of corner 2 rises
        grid.push_back(add_inner(patch, face, m, m - 2 - i, 1 + i - j, 1 + j));
    const auto at = [&](Index i, Index j) { return grid[i * (i + 1) / 2 + j]; };
    for (Index i = 0; i + 1 < rows; ++i)
      for (Index j = 0; j <= i; ++j) {
        add_triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1), face);
        if (j < i) add_triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1), face);
      }
    std::array<std::vector<Index>, 3> rims;
    for (Index i = 0; i < rows; ++i) {
      rims[0].push_back(at(i, 0));
      rims[1].push_back(at(rows - 1, i));
      rims[2].push_back(at(rows - 1 - i, rows - 1 - i));
    }
    for (std::size_t k = 0; k < 3; ++k) join(sides[k], rims[k], m, face);
  }

  /// Fills the strip between the points of a side and the rim of the grid.
  void join(const std::vector<Index>& outer, const std::vector<Index>& inner, Index m, Index face) {
    const auto parts = static_cast<double>(outer.size() - 1);
    std::size_t o = 0, i = 0;
    while (o + 1 < outer.size() || i + 1 < inner.size()) {
      const double next_outer = o + 1 < outer.size() ? (static_cast<double>(o) + 0.5) / parts : 2.0;
      const double next_inner = i + 1 < inner.size() ? (static_cast<double>(i) + 1.5) / m + 0.5 / m : 2.0;
      if (next_outer <= next_inner) {
        add_triangle(outer[o], outer[o + 1], inner[i], face);
        ++o;
      } else {
        add_triangle(outer[o], inner[i + 1], inner[i], face);
        ++i;
      }
    }
  }

  /// The ten control points of a triangular cubic patch.
  struct Patch {
    std::array<Vector3d, 3> corners;
    std::array<std::array<Vector3d, 2>, 3> sides;  ///< along each half-edge
    Vector3d centre;
  };
  Patch patch_of(Index face) const {
    Patch patch;
    Vector3d on_sides = Vector3d::Zero(), at_corners = Vector3d::Zero();
    for (Index k = 0; k < 3; ++k) {
      const Index h = 3 * face + k;
      const Edge& edge = edges_[edge_of_[h]];
      patch.corners[k] = vertex(corner(h));
      patch.sides[k] = {edge.control_a_m, edge.control_b_m};
      if (corner(h) != edge.a) std::swap(patch.sides[k][0], patch.sides[k][1]);
      on_sides += patch.sides[k][0] + patch.sides[k][1];
      at_corners += patch.corners[k];
    }
    patch.centre = on_sides / 4.0 - at_corners / 6.0;
    return patch;
  }

  /// Adds the point of the patch with weights i / m, j / m, k / m of its corners.
  Index add_inner(const Patch& patch, Index face, Index m, Index i, Index j, Index k) {
    const double u = static_cast<double>(i) / m, v = static_cast<double>(j) / m,
                 w = static_cast<double>(k) / m;
    const auto& [a, b, c] = patch.corners;
    const Vector3d flat_m = u * a + v * b + w * c;
    Vector3d p_m =
        u * u * u * a + v * v * v * b + w * w * w * c + 6.0 * u * v * w * patch.centre +
        3.0 * (u * u * v * patch.sides[0][0] + u * v * v * patch.sides[0][1] + v * v * w * patch.sides[1][0] +
               v * w * w * patch.sides[1][1] + w * w * u * patch.sides[2][0] + w * u * u * patch.sides[2][1]);
    const Vector3d n = (b - a).cross(c - a).normalized();
    const double height_m = std::abs(n.dot(p_m - a));
    if (height_m > most_m_) p_m = flat_m + most_m_ / height_m * (p_m - flat_m);
    measure(n.dot(p_m - a) * n, Vector3d::Zero());
    const auto& corners = mesh_.triangles[face];
    return add_point(p_m, i >= j && i >= k ? corners[0] : j >= k ? corners[1] : corners[2]);
  }

  const TriangleMesh& mesh_;
  double most_m_;
  std::vector<Edge> edges_;
  std::vector<Index> edge_of_;  ///< edge of each half-edge
  std::vector<Index> group_;    ///< corners that share a normal
  std::vector<Vector3d> normals_;
  std::vector<std::array<Index, 3>> creases_;  ///< two neighbours along creases, and the number of creases
  SimplifiedMesh out_;
};

}  // namespace

SimplifiedMesh smoothed(const TriangleMesh& mesh, const Smoothing& smoothing) {
  return MeshSmoother(mesh, smoothing).run();
}

}  // namespace wrenchd
