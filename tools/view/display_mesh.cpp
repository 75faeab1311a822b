// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/display_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace wrenchd {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using VertexNumbers = std::array<std::uint32_t, 3>;

/// Crease angle for simplified meshes, where a few cells may turn a smooth surface by more than kCrease_rad.
constexpr double kCoarseCrease_rad = 1.0;

struct Surface {
  std::vector<Vector3d> vertices;
  std::vector<VertexNumbers> triangles;

  Vector3d area(const VertexNumbers& t) const {
    return 0.5 * (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
  }
};

/// The vertices that merge into one: sum of the squared distances to the planes of their triangles.
struct Cell {
  Vector3d sum = Vector3d::Zero();  ///< sum of the vertices
  double count = 0.0;
  Matrix3d A = Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  std::uint32_t number = 0;

  /// Returns the point with the smallest sum of squared distances. If the minimum is a line or a plane,
  /// returns its point nearest to the mean.
  Vector3d best(double reach) const {
    constexpr double kFlat =
        1e-3;  ///< relative to the largest eigenvalue; smaller ones do not determine a direction
    const Vector3d mean = sum / count;
    const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(A);
    const Vector3d rest = b - A * mean;
    Vector3d step = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      const double lambda = solver.eigenvalues()[i];
      if (lambda <= kFlat * solver.eigenvalues()[2] || lambda <= 0.0) continue;
      step += solver.eigenvectors().col(i) * (solver.eigenvectors().col(i).dot(rest) / lambda);
    }
    return step.norm() <= reach ? Vector3d(mean + step) : mean;
  }
};

Surface clustered(const Surface& fine, const Vector3d& origin, double side) {
  std::unordered_map<std::uint64_t, Cell> cells;
  cells.reserve(fine.vertices.size() / 4);
  std::vector<Cell*> cell_of(fine.vertices.size());
  for (std::size_t i = 0; i < fine.vertices.size(); ++i) {
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k)  // 21 bits per axis suffice for any mesh that needs simplification
      key = key << 21U | (static_cast<std::uint64_t>((fine.vertices[i][k] - origin[k]) / side) & 0x1fffffU);
    Cell& cell = cells[key];
    if (cell.count == 0.0) cell.number = static_cast<std::uint32_t>(cells.size() - 1);
    cell.sum += fine.vertices[i];
    cell.count += 1.0;
    cell_of[i] = &cell;
  }
  for (const VertexNumbers& t : fine.triangles) {
    const Vector3d area = fine.area(t);
    const double size = area.norm();
    if (size == 0.0) continue;
    const Vector3d n = area / size;
    for (const std::uint32_t v : t) {
      cell_of[v]->A += size * n * n.transpose();
      cell_of[v]->b += size * n * n.dot(fine.vertices[t[0]]);
    }
  }
  Surface coarse;
  coarse.vertices.resize(cells.size());
  for (const auto& [key, cell] : cells) coarse.vertices[cell.number] = cell.best(side);
  std::map<VertexNumbers, int> sides;
  for (const VertexNumbers& t : fine.triangles) {
    VertexNumbers c = {cell_of[t[0]]->number, cell_of[t[1]]->number, cell_of[t[2]]->number};
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    const bool turned = c[1] > c[2];
    if (turned) std::swap(c[1], c[2]);
    sides[c] += turned ? -1 : 1;
  }
  // Two coincident triangles with opposite orientation are a collapsed fold; neither is drawn.
  for (const auto& [c, net] : sides) {
    if (net > 0) coarse.triangles.push_back(c);
    if (net < 0) coarse.triangles.push_back({c[0], c[2], c[1]});
  }
  return coarse;
}

Surface coarser(const Surface& fine, std::size_t most) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : fine.vertices) box.extend(p);
  double area = 0.0;
  for (const VertexNumbers& t : fine.triangles) area += fine.area(t).norm();
  // Gives about two triangles per cell that the surface intersects.
  double side = std::max(std::sqrt(2.0 * area / static_cast<double>(most)), box.sizes().maxCoeff() / 2e6);
  constexpr int kTries = 20;
  Surface coarse;
  for (int i = 0; i < kTries; ++i) {
    coarse = clustered(fine, box.min(), side);
    if (coarse.triangles.size() <= most) break;
    side *= 1.05 * std::sqrt(static_cast<double>(coarse.triangles.size()) / static_cast<double>(most));
  }
  return coarse;
}

/// The triangles at each vertex, stored consecutively.
struct Around {
  std::vector<std::uint32_t> begin, triangles;

  explicit Around(const Surface& s) : begin(s.vertices.size() + 1, 0), triangles(3 * s.triangles.size()) {
    for (const VertexNumbers& t : s.triangles)
      for (const std::uint32_t v : t) ++begin[v + 1];
    for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
    std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
    for (std::uint32_t i = 0; i < s.triangles.size(); ++i)
      for (const std::uint32_t v : s.triangles[i]) triangles[at[v]++] = i;
  }
  std::span<const std::uint32_t> of(std::uint32_t v) const {
    return {triangles.data() + begin[v], begin[v + 1] - begin[v]};
  }
};

void append_floats(std::vector<float>& to, const Vector3d& v) {
  for (int i = 0; i < 3; ++i) to.push_back(static_cast<float>(v[i]));
}

void draw(const Surface& s, bool made_coarser, DisplayMesh& out) {
  const double crease_cosine = std::cos(kCrease_rad);
  const double line_cosine = made_coarser ? std::cos(kCoarseCrease_rad) : crease_cosine;
  std::vector<Vector3d> areas, normals;
  for (const VertexNumbers& t : s.triangles) {
    areas.push_back(s.area(t));
    normals.push_back(areas.back().stableNormalized());
  }
  const Around around(s);
  std::vector<std::vector<std::pair<Vector3d, std::uint32_t>>> corners(s.vertices.size());
  // Returns the drawn vertex for a mesh vertex and this normal. Triangles share it where the surface is
  // smooth.
  const auto corner = [&](std::uint32_t v, const Vector3d& normal) {
    for (const auto& [known, number] : corners[v])
      if ((known - normal).squaredNorm() < 1e-8) return number;
    const auto number = static_cast<std::uint32_t>(out.positions.size() / 3);
    append_floats(out.positions, s.vertices[v]);
    append_floats(out.normals, normal);
    corners[v].emplace_back(normal, number);
    return number;
  };
  for (std::uint32_t i = 0; i < s.triangles.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = s.triangles[i][static_cast<std::size_t>(k)];
      const std::uint32_t w = s.triangles[i][static_cast<std::size_t>((k + 1) % 3)];
      Vector3d normal = Vector3d::Zero();
      for (const std::uint32_t j : around.of(v))
        if (normals[j].dot(normals[i]) >= crease_cosine) normal += areas[j];
      out.indices.push_back(corner(v, normal.isZero(0.0) ? normals[i] : Vector3d(normal.stableNormalized())));
      int others = 0;
      double straightest = -1.0;
      for (const std::uint32_t j : around.of(v)) {
        const VertexNumbers& t = s.triangles[j];
        if (j == i || std::find(t.begin(), t.end(), w) == t.end()) continue;
        ++others;
        straightest = std::max(straightest, normals[j].dot(normals[i]));
      }
      if (others > 0 && (straightest >= line_cosine || v > w))
        continue;                                 // only one of the two triangles draws their common edge
      if (made_coarser && others != 1) continue;  // open edges at merged cells are not edges of the body
      append_floats(out.lines, s.vertices[v]);
      append_floats(out.lines, s.vertices[w]);
    }
}

}  // namespace

DisplayMesh display_mesh(std::span<const float> vertices, std::span<const VertexNumbers> triangles,
                         std::size_t most) {
  Surface surface;
  for (std::size_t i = 0; i + 2 < vertices.size(); i += 3)
    surface.vertices.emplace_back(vertices[i], vertices[i + 1], vertices[i + 2]);
  for (const VertexNumbers& t : triangles)
    for (const std::uint32_t v : t)
      if (v >= surface.vertices.size())
        throw std::invalid_argument("a triangle refers to vertex " + std::to_string(v) + " of " +
                                    std::to_string(surface.vertices.size()));
  surface.triangles.assign(triangles.begin(), triangles.end());
  DisplayMesh out;
  out.source_triangles = triangles.size();
  const bool make_coarser = triangles.size() > most;
  if (make_coarser) surface = coarser(surface, most);
  draw(surface, make_coarser, out);
  return out;
}

}  // namespace wrenchd
