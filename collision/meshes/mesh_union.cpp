// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_union.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/bbox.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/helpers.h>

#include "collision/meshes/mesh_check.hpp"

namespace wrenchd {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

SurfaceMesh cgal_mesh(const TriangleMesh& mesh) {
  SurfaceMesh out;
  for (const Vector3d& p : mesh.vertices_m) out.add_vertex({p.x(), p.y(), p.z()});
  using Vertex = SurfaceMesh::Vertex_index;
  for (const auto& [a, b, c] : mesh.triangles) out.add_face(Vertex(a), Vertex(b), Vertex(c));
  return out;
}

PolygonSoup soup_of(SurfaceMesh& mesh) {
  mesh.collect_garbage();
  PolygonSoup soup;
  for (const auto v : mesh.vertices())
    soup.vertices.emplace_back(mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z());
  for (const auto f : mesh.faces()) {
    std::vector<std::size_t>& face = soup.faces.emplace_back();
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) face.push_back(v);
  }
  return soup;
}

/// Adds a part to the union. Returns false if corefinement fails.
bool add_part(SurfaceMesh part, SurfaceMesh& all) {
  if (!CGAL::do_overlap(PMP::bbox(part), PMP::bbox(all))) {
    all.join(part);
    return true;
  }
  SurfaceMesh result;
  try {
    if (!PMP::corefine_and_compute_union(all, part, result,
                                         CGAL::parameters::throw_on_self_intersection(true)))
      return false;
  } catch (const std::exception&) {  // parts that intersect themselves, or a failed precondition
    return false;
  }
  // Where parts touch, CGAL 5.5 may report success and return a mesh that is no valid data structure. The
  // next union would then crash or never end.
  if (!CGAL::is_valid_polygon_mesh(result) || !CGAL::is_closed(result)) return false;
  all = std::move(result);
  return true;
}

}  // namespace

TriangleMesh together(const std::vector<TriangleMesh>& parts) {
  TriangleMesh all;
  for (const TriangleMesh& part : parts) {
    const auto first = static_cast<std::uint32_t>(all.vertices_m.size());
    all.vertices_m.insert(all.vertices_m.end(), part.vertices_m.begin(), part.vertices_m.end());
    for (const auto& [a, b, c] : part.triangles) all.triangles.push_back({first + a, first + b, first + c});
  }
  return all;
}

UnitedMesh unite(const std::vector<TriangleMesh>& parts) {
  UnitedMesh out;
  if (parts.size() == 1) {
    out.mesh = parts.front();
    return out;
  }
  SurfaceMesh all;
  out.united = std::all_of(parts.begin(), parts.end(), [&](const TriangleMesh& part) {
    SurfaceMesh one = cgal_mesh(part);
    return one.number_of_faces() == part.triangles.size() && add_part(std::move(one), all);
  });
  if (out.united) {
    PolygonSoup soup = soup_of(all);
    out.united = repair_and_check_solid(soup, &out.mesh).solid();
  }
  if (!out.united) out.mesh = together(parts);
  return out;
}

}  // namespace wrenchd
