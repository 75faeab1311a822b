// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <locale>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_2_algorithms.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/triangulate_faces.h>
#include <CGAL/Projection_traits_3.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/property_map.h>

#include "collision/meshes/defect_count.hpp"
#include "collision/meshes/half_edges.hpp"
#include "collision/meshes/mesh_repair.hpp"
#include "collision/meshes/self_intersection.hpp"

namespace wrenchd {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using FacePair = std::pair<SurfaceMesh::Face_index, SurfaceMesh::Face_index>;
using DirectedEdge = std::pair<std::size_t, std::size_t>;  ///< from, to

std::string edge_place(const PolygonSoup& soup, const DirectedEdge& e) {
  return format_point(soup.vertices[e.first]) + " to " + format_point(soup.vertices[e.second]);
}

/// Prints an index. A negative index of the file has wrapped around and is printed as in the file.
std::string index_text(std::size_t v) {
  return v > std::numeric_limits<std::size_t>::max() / 2 ? "-" + std::to_string(0 - v) : std::to_string(v);
}

/// In a mesh that intersects itself everywhere the number of pairs grows with the square of the faces.
constexpr std::size_t kMaxIntersections = 20'000;

/// Largest overlap of two faces that is tolerated, as a fraction of the mesh's diagonal. Exporters of CAD
/// programs create such overlaps when they triangulate and round.
constexpr double kMaxOverlap = 1e-5;

std::string face_name(const PolygonSoup& soup, std::size_t f) {
  return "face " + std::to_string(soup.face_in_file(f));
}

bool uses_a_vertex_twice(const std::vector<std::size_t>& face) {
  if (face.size() == 3) return face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
  return std::set<std::size_t>(face.begin(), face.end()).size() != face.size();
}

/// All later checks need finite coordinates and valid indices.
void check_numbers(const PolygonSoup& soup, std::vector<std::string>& defects) {
  DefectCount not_finite, out_of_range;
  for (std::size_t v = 0; v < soup.vertices.size(); ++v)
    if (!soup.vertices[v].allFinite())
      not_finite.add([&] {
        return "vertex " + std::to_string(soup.vertex_in_file(v)) +
               " is not a number: " + format_point(soup.vertices[v]);
      });
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    for (const std::size_t v : soup.faces[f])
      if (v >= soup.vertices.size())
        out_of_range.add([&] {
          return face_name(soup, f) + " uses vertex " + index_text(v) + ", but there are only " +
                 std::to_string(soup.vertices.size());
        });
  }
  not_finite.report(defects, "export the mesh again");
  out_of_range.report(defects, "vertex numbers start at 0; export the mesh again");
}

/// Checks that every face is a polygon.
void check_elements(const PolygonSoup& soup, std::vector<std::string>& defects) {
  check_numbers(soup, defects);
  DefectCount too_few, repeated;
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const auto& face = soup.faces[f];
    if (face.size() < 3)
      too_few.add([&] { return face_name(soup, f) + " has " + std::to_string(face.size()) + " vertices"; });
    if (uses_a_vertex_twice(face)) repeated.add([&] { return face_name(soup, f) + " uses a vertex twice"; });
  }
  too_few.report(defects, "remove it");
  repeated.report(defects, "remove degenerate faces in the modeller");
}

double area_of(const PolygonSoup& soup, const std::vector<std::size_t>& face) {
  Vector3d twice = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < face.size(); ++i)
    twice += (soup.vertices[face[i]] - soup.vertices[face[0]])
                 .cross(soup.vertices[face[i + 1]] - soup.vertices[face[0]]);
  return 0.5 * twice.norm();
}

void check_areas(const PolygonSoup& soup, std::vector<std::string>& defects) {
  DefectCount flat;
  for (std::size_t f = 0; f < soup.faces.size(); ++f)
    if (!(area_of(soup, soup.faces[f]) > 0.0))
      flat.add([&] {
        return face_name(soup, f) + " near " + format_point(soup.vertices[soup.faces[f][0]]) + " has no area";
      });
  flat.report(defects, "remove degenerate faces in the modeller");
}

/// Checks that every edge occurs once in each direction: the mesh is closed and consistently oriented.
void check_edges(const PolygonSoup& soup, MeshReport& report) {
  DefectCount open, crowded, same_direction;
  for_each_edge(half_edges_of(soup), [&](std::span<const HalfEdge> half_edges) {
    const auto where = [&] {
      const DirectedEdge& e = half_edges[0].edge;
      const bool as_stored = half_edges[0].forward || half_edges.size() > 2;
      return "the edge from " + edge_place(soup, as_stored ? e : DirectedEdge(e.second, e.first));
    };
    const auto face = [&](std::size_t k) { return std::to_string(soup.face_in_file(half_edges[k].face)); };
    if (half_edges.size() == 1)
      open.add([&] { return where() + " belongs to face " + face(0) + " only: the surface is open"; });
    else if (half_edges.size() > 2)
      crowded.add([&] { return where() + " belongs to " + std::to_string(half_edges.size()) + " faces"; });
    else if (half_edges[0].forward == half_edges[1].forward)
      same_direction.add([&] {
        return "faces " + face(0) + " and " + face(1) + " are oriented against each other along " + where();
      });
  });
  open.report(report.defects, "close the hole in the modeller");
  crowded.report(report.defects, "a solid has two faces at every edge: split or remove the extra ones");
  same_direction.report(report.defects, "make all faces counter-clockwise seen from outside");
  report.closed = !open.any() && !crowded.any();
  report.consistent = !same_direction.any();
}

/// Every edge has two faces here, so the faces at a vertex form rings. A face that leaves the vertex towards
/// n is followed by the face that arrives from n. A vertex with more than one ring joins parts of the surface
/// in a point.
void check_vertices(const PolygonSoup& soup, MeshReport& report) {
  struct FaceCorner {
    std::size_t from, to;  ///< a face arrives from `from` and leaves towards `to`
  };
  std::vector<std::size_t> begin_of(soup.vertices.size() + 1, 0);
  for (const auto& face : soup.faces)
    for (const std::size_t v : face) ++begin_of[v + 1];
  std::partial_sum(begin_of.begin(), begin_of.end(), begin_of.begin());
  std::vector<FaceCorner> corners(begin_of.back());
  std::vector<std::size_t> at_vertex(begin_of.begin(), begin_of.end() - 1);
  for (const auto& face : soup.faces)
    for (std::size_t i = 0; i < face.size(); ++i)
      corners[at_vertex[face[i]]++] = {face[i > 0 ? i - 1 : face.size() - 1],
                                       face[i + 1 < face.size() ? i + 1 : 0]};
  const auto before = [](const FaceCorner& a, const FaceCorner& b) { return a.from < b.from; };
  DefectCount pinched;
  for (std::size_t v = 0; v < soup.vertices.size(); ++v) {
    const auto begin = corners.begin() + static_cast<std::ptrdiff_t>(begin_of[v]),
               end = corners.begin() + static_cast<std::ptrdiff_t>(begin_of[v + 1]);
    if (begin == end) continue;
    std::sort(begin, end, before);
    std::ptrdiff_t ring = 0;
    auto at = begin;
    do {
      at = std::lower_bound(begin, end, FaceCorner{at->to, 0}, before);
    } while (++ring < end - begin && at != begin);
    if (ring < end - begin)
      pinched.add([&] {
        return "parts of the surface are joined only in vertex " + std::to_string(soup.vertex_in_file(v)) +
               " at " + format_point(soup.vertices[v]);
      });
  }
  pinched.report(report.defects, "separate them in the modeller");
}

SurfaceMesh surface_mesh(const PolygonSoup& soup) {
  std::vector<Kernel::Point_3> points;
  points.reserve(soup.vertices.size());
  for (const Vector3d& p : soup.vertices) points.emplace_back(p.x(), p.y(), p.z());
  auto faces = soup.faces;
  PMP::remove_isolated_points_in_polygon_soup(points,
                                              faces);  // isolated points make does_bound_a_volume() fail
  SurfaceMesh mesh;
  PMP::polygon_soup_to_polygon_mesh(points, faces, mesh);
  return mesh;
}

/// Returns true if a face, projected along its normal, neither crosses nor touches itself. CGAL also
/// triangulates other faces with more than four corners, and crashes on some of them.
bool is_simple(const PolygonSoup& soup, const std::vector<std::size_t>& face) {
  Vector3d normal = Vector3d::Zero();
  std::vector<Kernel::Point_3> points;
  for (std::size_t i = 0; i < face.size(); ++i) {
    const Vector3d &p = soup.vertices[face[i]], &next = soup.vertices[face[(i + 1) % face.size()]];
    normal += p.cross(next);
    points.emplace_back(p.x(), p.y(), p.z());
  }
  if (!normal.allFinite() || normal.isZero(0.0)) return false;
  const CGAL::Projection_traits_3<Kernel> along({normal.x(), normal.y(), normal.z()});
  return CGAL::is_simple_2(points.begin(), points.end(), along);
}

/// Triangulates every face of a mesh made from the soup. Returns the face number in the file for each
/// triangle.
std::vector<std::size_t> triangulate(const PolygonSoup& soup, SurfaceMesh& mesh, MeshReport& report) {
  std::vector<std::size_t> face_of(soup.faces.size());
  DefectCount uncut;
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    face_of[f] = soup.face_in_file(f);  // its first triangle keeps the index
    const std::size_t corners = soup.faces[f].size();
    if ((corners > 4 && !is_simple(soup, soup.faces[f])) ||
        (corners > 3 && !PMP::triangulate_face(SurfaceMesh::Face_index(static_cast<std::uint32_t>(f)), mesh)))
      uncut.add([&] {
        return face_name(soup, f) + " near " + format_point(soup.vertices[soup.faces[f][0]]) +
               " cannot be triangulated";
      });
    face_of.resize(mesh.number_of_faces(), soup.face_in_file(f));
  }
  uncut.report(report.defects, "make it planar, or triangulate it in the modeller");
  return face_of;
}

using MeshTriangle = std::array<Vector3d, 3>;

MeshTriangle triangle_of(const SurfaceMesh& mesh, SurfaceMesh::Face_index face) {
  MeshTriangle corners;
  std::size_t k = 0;
  for (const auto v : mesh.vertices_around_face(mesh.halfedge(face))) {
    const auto& p = mesh.point(v);
    corners[k++ % 3] = {p.x(), p.y(), p.z()};
  }
  return corners;
}

/// Returns how far one of two intersecting triangles must move so that they touch at most: the least overlap
/// of their projections on an axis, over all axes on which triangles can be separated.
double overlap_of(const MeshTriangle& a, const MeshTriangle& b) {
  double least = std::numeric_limits<double>::infinity();
  const auto test = [&](const Vector3d& axis) {
    const double length = axis.norm();
    if (!(length > 0.0)) return;
    const auto range = [&](const MeshTriangle& t) {
      const double p = axis.dot(t[0]), q = axis.dot(t[1]), r = axis.dot(t[2]);
      return std::pair(std::min({p, q, r}), std::max({p, q, r}));
    };
    const auto [a_low, a_high] = range(a);
    const auto [b_low, b_high] = range(b);
    least = std::min(least, std::min(a_high - b_low, b_high - a_low) / length);
  };
  const auto side = [](const MeshTriangle& t, std::size_t i) -> Vector3d { return t[(i + 1) % 3] - t[i]; };
  const Vector3d normal_a = side(a, 0).cross(side(a, 1)), normal_b = side(b, 0).cross(side(b, 1));
  test(normal_a);
  test(normal_b);
  for (std::size_t i = 0; i < 3; ++i) {
    test(normal_a.cross(side(a, i)));
    test(normal_b.cross(side(b, i)));
    for (std::size_t k = 0; k < 3; ++k) {
      // The cross product of nearly parallel sides is rounding, and no axis.
      const Vector3d axis = side(a, i).cross(side(b, k));
      if (axis.norm() > 1e-6 * side(a, i).norm() * side(b, k).norm()) test(axis);
    }
  }
  return std::max(least, 0.0);
}

/// Counts how often closed shells enclose a point: 0 outside, 1 inside of a solid, 2 where two solids
/// overlap, -1 where a surface is folded inside out.
class WindingNumber {
 public:
  explicit WindingNumber(const SurfaceMesh& mesh)
      : mesh_(mesh), tree_(faces(mesh).begin(), faces(mesh).end(), mesh) {
    tree_.build();
    for (const auto v : mesh.vertices()) box_ += mesh.point(v).bbox();
  }

  /// Returns nothing if every ray that was tried passes through an edge.
  std::optional<int> at(const Vector3d& p_m) const {
    const Kernel::Point_3 p(p_m.x(), p_m.y(), p_m.z());
    const double reach =
        4.0 * (box_.xmax() - box_.xmin() + box_.ymax() - box_.ymin() + box_.zmax() - box_.zmin());
    for (const Vector3d& direction :
         {Vector3d(0.8626, 0.3919, 0.3199), Vector3d(-0.3577, 0.8713, 0.3361),
          Vector3d(0.2153, -0.4441, 0.8697), Vector3d(-0.7129, -0.5101, -0.4811)}) {
      const Vector3d far = p_m + reach * direction;
      const Kernel::Point_3 q(far.x(), far.y(), far.z());
      std::vector<SurfaceMesh::Face_index> hit;
      tree_.all_intersected_primitives(Kernel::Segment_3(p, q), std::back_inserter(hit));
      int count = 0;
      bool clear = true;
      for (const auto f : hit) {
        std::array<Kernel::Point_3, 3> t;
        std::size_t k = 0;
        for (const auto v : mesh_.vertices_around_face(mesh_.halfedge(f))) t[k++ % 3] = mesh_.point(v);
        for (std::size_t i = 0; i < 3; ++i)
          clear = clear && CGAL::orientation(p, q, t[i], t[(i + 1) % 3]) != CGAL::COPLANAR;
        const CGAL::Orientation side = CGAL::orientation(t[0], t[1], t[2], p);
        clear = clear && side != CGAL::COPLANAR;
        count += side == CGAL::NEGATIVE ? 1 : -1;  // the segment leaves through the face, or enters
      }
      if (clear) return count;
    }
    return {};
  }

 private:
  using Primitive = CGAL::AABB_face_graph_triangle_primitive<SurfaceMesh>;
  const SurfaceMesh& mesh_;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree_;
  CGAL::Bbox_3 box_;
};

using ShellOfFace = std::vector<std::size_t>;

ShellOfFace shells_of(const SurfaceMesh& mesh) {
  ShellOfFace shell(mesh.number_of_faces());
  PMP::connected_components(mesh, CGAL::make_property_map(shell));
  return shell;
}

/// Returns true if a mesh whose faces intersect bounds one solid: on both sides of each of these faces, and
/// of one face of each shell, the winding number is 0 or 1 at this distance. So parts that overlap deeply are
/// found even if each pair of faces only touches.
bool bounds_one_solid(const SurfaceMesh& mesh, const std::vector<FacePair>& pairs, const ShellOfFace& shell,
                      double distance) {
  std::set<SurfaceMesh::Face_index> some;
  for (const auto& [a, b] : pairs) some.insert({a, b});
  std::set<std::size_t> known;
  for (const auto f : mesh.faces())
    if (known.insert(shell[f]).second) some.insert(f);
  const WindingNumber winding(mesh);
  for (const auto f : some) {
    const MeshTriangle t = triangle_of(mesh, f);
    const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized(),
                   middle = (t[0] + t[1] + t[2]) / 3.0;
    for (const Vector3d& p : {middle, Vector3d(0.7 * t[0] + 0.3 * middle),
                              Vector3d(0.7 * t[1] + 0.3 * middle), Vector3d(0.7 * t[2] + 0.3 * middle)})
      for (const double side : {-1.0, 1.0}) {
        const std::optional<int> count = winding.at(p + side * distance * normal);
        if (count && (*count < 0 || *count > 1)) return false;
      }
  }
  return true;
}

/// Names two faces that intersect and the number of all pairs.
std::string intersection_text(const SurfaceMesh& mesh, const std::vector<FacePair>& pairs,
                              const std::vector<std::size_t>& face_of, const std::string& verb) {
  const auto corner = mesh.point(mesh.target(mesh.halfedge(pairs[0].first)));
  const std::size_t a = face_of[pairs[0].first], b = face_of[pairs[0].second];
  return (a == b ? "two halves of face " + std::to_string(a)
                 : "faces " + std::to_string(a) + " and " + std::to_string(b)) +
         " near " + format_point({corner.x(), corner.y(), corner.z()}) + ' ' + verb +
         (pairs.size() < kMaxIntersections ? total_suffix(pairs.size())
                                           : " (" + std::to_string(kMaxIntersections) + " or more in all)");
}

/// triangles: the faces of the mesh, in the same order.
void check_self_intersection(const PolygonSoup& soup, const SurfaceMesh& mesh, const TriangleMesh& triangles,
                             const std::vector<std::size_t>& face_of, MeshReport& report) {
  std::vector<FacePair> pairs;
  for (const auto& [a, b] : self_intersections(triangles, kMaxIntersections))
    pairs.emplace_back(SurfaceMesh::Face_index(a), SurfaceMesh::Face_index(b));
  if (pairs.empty()) return;
  const ShellOfFace shell = shells_of(mesh);
  if (pairs.size() < kMaxIntersections) {
    double overlap = 0.0;
    for (const auto& [a, b] : pairs)
      overlap = std::max(overlap, overlap_of(triangle_of(mesh, a), triangle_of(mesh, b)));
    CGAL::Bbox_3 box;
    for (const auto v : mesh.vertices()) box += mesh.point(v).bbox();
    const double diagonal =
        Vector3d(box.xmax() - box.xmin(), box.ymax() - box.ymin(), box.zmax() - box.zmin()).norm();
    if (overlap <= kMaxOverlap * diagonal &&
        bounds_one_solid(mesh, pairs, shell, 1.5 * kMaxOverlap * diagonal)) {
      std::ostringstream depth;
      depth.imbue(std::locale::classic());
      depth.precision(2);
      depth << overlap / diagonal;
      report.tolerated = intersection_text(mesh, pairs, face_of, "overlap") + " by at most " + depth.str() +
                         " of the diagonal of the mesh; contacts use all of them";
      return;
    }
  }
  report.self_intersecting = true;
  // The parts are one body only if each of them is a solid by itself. A single shell is not checked again.
  const bool between_shells =
      std::any_of(shell.begin(), shell.end(), [&](std::size_t number) { return number != shell[0]; }) &&
      !solid_shells(soup).empty();
  report.defects.push_back(
      intersection_text(mesh, pairs, face_of, "intersect each other") +
      (between_shells
           ? "; unite the parts in the modeller, or give the file as a list of parts, meshes = "
             "[\"FILE\"], which are then one body"
           : "; a shell passes through itself: use the file with kind = \"surface\", or remesh it in the "
             "modeller"));
}

void check_volume(const SurfaceMesh& mesh, MeshReport& report) {
  report.volume = CGAL::to_double(PMP::volume(mesh));
  report.outward = !report.self_intersecting && report.volume > 0.0 &&
                   (!report.tolerated.empty() || PMP::does_bound_a_volume(mesh));
  if (report.outward || report.self_intersecting) return;
  report.defects.push_back(
      report.volume < 0.0 ? "all faces point inwards (the volume is negative); flip the faces in the modeller"
                          : "its shells do not bound a volume: one faces the wrong way, or encloses nothing; "
                            "make outer shells face outwards and cavities inwards");
}

/// Returns a mesh of separate faces that share no vertex, so that non-manifold soups can be triangulated. Its
/// vertices are the corners of the faces in order.
SurfaceMesh separate_faces(const PolygonSoup& soup) {
  PolygonSoup apart;
  for (const auto& face : soup.faces) {
    auto& copy = apart.faces.emplace_back();
    for (const std::size_t v : face) {
      copy.push_back(apart.vertices.size());
      apart.vertices.push_back(soup.vertices[v]);
    }
  }
  return surface_mesh(apart);
}

TriangleMesh triangles_of(const SurfaceMesh& mesh) {
  TriangleMesh out;
  for (const auto v : mesh.vertices())
    out.vertices_m.emplace_back(mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z());
  for (const auto f : mesh.faces()) {
    std::array<std::uint32_t, 3> triangle{};
    std::size_t k = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) triangle[k++ % 3] = v;
    out.triangles.push_back(triangle);
  }
  return out;
}

MeshReport report_on(const PolygonSoup& soup) {
  MeshReport report;
  report.vertices = soup.vertices.size();
  report.faces = soup.faces.size();
  report.volume = std::numeric_limits<double>::quiet_NaN();
  check_elements(soup, report.defects);
  return report;
}

}  // namespace

std::vector<std::string> find_invalid_values(const PolygonSoup& soup) {
  std::vector<std::string> defects;
  check_numbers(soup, defects);
  return defects;
}

MeshReport check_surface(const PolygonSoup& soup, TriangleMesh* triangles) {
  MeshReport report = report_on(soup);
  if (soup.faces.empty())
    report.defects.push_back(
        "there is no face that has an area; look for a vertex that is much too far away");
  if (!report.defects.empty()) return report;
  check_areas(soup, report.defects);
  if (!report.defects.empty()) return report;
  SurfaceMesh mesh = separate_faces(soup);
  triangulate(soup, mesh, report);
  if (triangles == nullptr || !report.defects.empty()) return report;
  std::vector<std::uint32_t> vertex;  // soup vertex for each vertex of the mesh
  for (const auto& face : soup.faces) vertex.insert(vertex.end(), face.begin(), face.end());
  *triangles = triangles_of(mesh);
  triangles->vertices_m = soup.vertices;
  for (auto& corners : triangles->triangles)
    for (std::uint32_t& v : corners) v = vertex[v];
  return report;
}

MeshReport repair_and_check_solid(PolygonSoup& soup, TriangleMesh* triangles) {
  std::vector<std::string> changes = repair(soup);
  MeshReport report = check_solid(soup, triangles);
  report.repairs = std::move(changes);
  return report;
}

MeshReport repair_and_check_surface(PolygonSoup& soup, TriangleMesh* triangles) {
  std::vector<std::string> changes = repair(soup);
  MeshReport report = check_surface(soup, triangles);
  report.repairs = std::move(changes);
  return report;
}

MeshReport check_solid(const PolygonSoup& soup, TriangleMesh* triangles) {
  MeshReport report = report_on(soup);
  if (!report.defects.empty()) return report;
  check_areas(soup, report.defects);
  check_edges(soup, report);
  if (!report.defects.empty()) return report;
  check_vertices(soup, report);
  if (!report.defects.empty()) return report;
  SurfaceMesh mesh = surface_mesh(soup);
  const std::vector<std::size_t> face_of = triangulate(soup, mesh, report);
  if (!report.defects.empty()) return report;
  TriangleMesh checked = triangles_of(mesh);
  check_self_intersection(soup, mesh, checked, face_of, report);
  check_volume(mesh, report);
  if (triangles != nullptr && report.solid()) *triangles = std::move(checked);
  return report;
}

std::vector<TriangleMesh> solid_shells(const PolygonSoup& soup) {
  if (!find_invalid_values(soup).empty()) return {};
  std::vector<std::size_t> into(soup.vertices.size());
  std::iota(into.begin(), into.end(), std::size_t{0});
  const auto root = [&](std::size_t v) {
    while (into[v] != v) v = into[v] = into[into[v]];
    return v;
  };
  for (const auto& face : soup.faces)
    for (const std::size_t v : face) {
      const std::size_t a = root(face[0]), b = root(v);
      into[std::max(a, b)] = std::min(a, b);
    }
  std::map<std::size_t, PolygonSoup>
      shells;  // by the smallest vertex, so that their order is that of the file
  std::vector<std::size_t> number(soup.vertices.size(), soup.vertices.size());
  for (const auto& face : soup.faces) {
    if (face.empty()) return {};
    PolygonSoup& shell = shells[root(face[0])];
    auto& copy = shell.faces.emplace_back();
    for (const std::size_t v : face) {
      if (number[v] == soup.vertices.size()) {
        number[v] = shell.vertices.size();
        shell.vertices.push_back(soup.vertices[v]);
      }
      copy.push_back(number[v]);
    }
  }
  std::vector<TriangleMesh> out;
  for (const auto& [first, shell] : shells) {
    TriangleMesh mesh;
    if (!check_solid(shell, &mesh).solid()) return {};
    out.push_back(std::move(mesh));
  }
  return out;
}

}  // namespace wrenchd
