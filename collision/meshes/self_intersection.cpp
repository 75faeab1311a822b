// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/self_intersection.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include "core/in_parallel.hpp"

namespace wrenchd {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
/// A mesh of triangles for CGAL, with exact predicates.
using ExactMesh = CGAL::Surface_mesh<CGAL::Exact_predicates_inexact_constructions_kernel::Point_3>;
using FacePair = std::pair<ExactMesh::Face_index, ExactMesh::Face_index>;
using Faces = std::vector<ExactMesh::Face_index>;

/// A smaller part takes less time than the start of its thread is worth.
constexpr std::size_t kLeastFacesPerThread = 25'000;

/// Index of the longest side of the bounding box.
int longest_axis(const ExactMesh& mesh) {
  CGAL::Bbox_3 box;
  for (const auto v : mesh.vertices()) box += mesh.point(v).bbox();
  int longest = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (box.max(axis) - box.min(axis) > box.max(longest) - box.min(longest)) longest = axis;
  return longest;
}

/// Divides the faces by planes across the axis, about the same number between two planes. Two faces that
/// intersect are in one part together: a face that reaches into several parts is in each of them.
std::vector<Faces> divide(const ExactMesh& mesh, int axis, std::size_t parts) {
  struct Extent {
    double low, high;
  };
  std::vector<Extent> extents;
  std::vector<double> middles;
  extents.reserve(mesh.number_of_faces());
  middles.reserve(mesh.number_of_faces());
  for (const auto f : mesh.faces()) {
    Extent extent = {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) {
      extent.low = std::min(extent.low, mesh.point(v)[axis]);
      extent.high = std::max(extent.high, mesh.point(v)[axis]);
    }
    extents.push_back(extent);
    middles.push_back(0.5 * (extent.low + extent.high));
  }
  std::vector<double> cuts = {-std::numeric_limits<double>::infinity()};
  for (std::size_t i = 1; i < parts; ++i) {
    const auto at = middles.begin() + static_cast<std::ptrdiff_t>(i * middles.size() / parts);
    std::nth_element(middles.begin(), at, middles.end());
    cuts.push_back(*at);
  }
  cuts.push_back(std::numeric_limits<double>::infinity());
  std::vector<Faces> divided(parts);
  std::size_t number = 0;
  for (const auto f : mesh.faces()) {
    const auto [low, high] = extents[number++];
    for (std::size_t i = 0; i < parts; ++i)
      if (low <= cuts[i + 1] && high >= cuts[i]) divided[i].push_back(f);
  }
  return divided;
}

ExactMesh exact_mesh(const TriangleMesh& mesh) {
  ExactMesh exact;
  exact.reserve(static_cast<ExactMesh::size_type>(mesh.vertices_m.size()),
                static_cast<ExactMesh::size_type>(3 * mesh.triangles.size() / 2),
                static_cast<ExactMesh::size_type>(mesh.triangles.size()));
  for (const Vector3d& p : mesh.vertices_m) exact.add_vertex({p.x(), p.y(), p.z()});
  using Vertex = ExactMesh::Vertex_index;
  for (const auto& [a, b, c] : mesh.triangles) exact.add_face(Vertex(a), Vertex(b), Vertex(c));
  return exact;
}

}  // namespace

std::vector<TrianglePairNumbers> self_intersections(const TriangleMesh& mesh, std::size_t most) {
  const ExactMesh exact = exact_mesh(mesh);
  const std::size_t parts = threads_for(mesh.triangles.size(), kLeastFacesPerThread);
  const auto named = CGAL::parameters::maximum_number(most);
  std::vector<std::vector<FacePair>> found(parts);
  if (parts == 1) {
    PMP::self_intersections(exact, std::back_inserter(found[0]), named);
  } else {
    const std::vector<Faces> divided = divide(exact, longest_axis(exact), parts);
    in_parallel(parts, parts, [&](std::size_t i) {
      PMP::self_intersections(divided[i], exact, std::back_inserter(found[i]), named);
    });
  }
  std::vector<TrianglePairNumbers> pairs;
  for (const std::vector<FacePair>& part : found)
    for (const auto& [a, b] : part) pairs.push_back({std::min(a, b), std::max(a, b)});
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  if (pairs.size() > most) pairs.resize(most);
  return pairs;
}

bool intersects_itself(const TriangleMesh& mesh) {
  return !self_intersections(mesh, 1).empty();
}

}  // namespace wrenchd
