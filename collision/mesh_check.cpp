// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/mesh_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <sstream>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Polygon_mesh_processing/triangulate_faces.h>
#include <CGAL/Surface_mesh.h>

namespace wrenchd {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Edge = std::pair<std::size_t, std::size_t>;  ///< from, to

std::string place(const Vector3d& p) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << '(' << p.x() << ", " << p.y() << ", " << p.z() << ')';
  return text.str();
}

std::string edge_place(const PolygonSoup& soup, const Edge& e) {
  return place(soup.vertices[e.first]) + " to " + place(soup.vertices[e.second]);
}

std::string also(std::size_t count) {
  return count > 1 ? " (" + std::to_string(count) + " in all)" : "";
}

/// A negative index of the file has wrapped around; it is told as it was written.
std::string index_text(std::size_t v) {
  return v > std::numeric_limits<std::size_t>::max() / 2 ? "-" + std::to_string(0 - v) : std::to_string(v);
}

/// Where everything cuts through everything, pairs grow with the square of the faces.
constexpr std::size_t kMostIntersections = 1000;

/// First place and number of a kind of defect.
class Tally {
 public:
  /// sentence: makes the text, which only the first of a million needs.
  template <class Sentence>
  void found(const Sentence& sentence) {
    if (count_++ == 0) first_ = sentence();
  }
  void report(std::vector<std::string>& defects, const std::string& cure) const {
    if (count_ > 0) defects.push_back(first_ + also(count_) + "; " + cure);
  }
  bool any() const { return count_ > 0; }

 private:
  std::size_t count_ = 0;
  std::string first_;
};

std::string face_name(std::size_t f) {
  return "face " + std::to_string(f);
}

bool uses_a_vertex_twice(const std::vector<std::size_t>& face) {
  if (face.size() == 3) return face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
  return std::set<std::size_t>(face.begin(), face.end()).size() != face.size();
}

/// Numbers, indices and faces that are no polygons. Without these right, nothing else can be asked.
void check_elements(const PolygonSoup& soup, std::vector<std::string>& defects) {
  Tally not_finite, out_of_range, too_few, repeated;
  for (std::size_t v = 0; v < soup.vertices.size(); ++v)
    if (!soup.vertices[v].allFinite())
      not_finite.found(
          [&] { return "vertex " + std::to_string(v) + " is not a number: " + place(soup.vertices[v]); });
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const auto& face = soup.faces[f];
    if (face.size() < 3)
      too_few.found([&] { return face_name(f) + " has " + std::to_string(face.size()) + " vertices"; });
    for (const std::size_t v : face)
      if (v >= soup.vertices.size())
        out_of_range.found([&] {
          return face_name(f) + " uses vertex " + index_text(v) + ", but there are only " +
                 std::to_string(soup.vertices.size());
        });
    if (uses_a_vertex_twice(face)) repeated.found([&] { return face_name(f) + " uses a vertex twice"; });
  }
  not_finite.report(defects, "export the mesh again");
  out_of_range.report(defects, "vertex numbers start at 0; export the mesh again");
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
  Tally flat;
  for (std::size_t f = 0; f < soup.faces.size(); ++f)
    if (!(area_of(soup, soup.faces[f]) > 0.0))
      flat.found(
          [&] { return face_name(f) + " near " + place(soup.vertices[soup.faces[f][0]]) + " has no area"; });
  flat.report(defects, "remove degenerate faces in the modeller");
}

/// A side of a face, as the face runs along it.
struct Side {
  Edge edge;  ///< the smaller vertex first
  std::size_t face;
  bool forward;  ///< from the smaller vertex to the larger
};

/// Of all faces, those of one edge next to each other, in the order of the faces.
std::vector<Side> sides_of(const PolygonSoup& soup) {
  std::vector<Side> sides;
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const auto& face = soup.faces[f];
    for (std::size_t i = 0; i < face.size(); ++i) {
      const auto [low, high] = std::minmax(face[i], face[i + 1 < face.size() ? i + 1 : 0]);
      sides.push_back({{low, high}, f, low == face[i]});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.edge != b.edge ? a.edge < b.edge : a.face < b.face;
  });
  return sides;
}

/// Closed and consistently oriented: every edge runs once in each direction.
void check_edges(const PolygonSoup& soup, MeshReport& report) {
  const std::vector<Side> sides = sides_of(soup);
  Tally open, crowded, same_way;
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    while (end < sides.size() && sides[end].edge == sides[i].edge) ++end;
    const auto where = [&, i] {
      const Edge& e = sides[i].edge;
      const bool as_stored = sides[i].forward || end - i > 2;
      return "the edge from " + edge_place(soup, as_stored ? e : Edge(e.second, e.first));
    };
    const auto face = [&](std::size_t k) { return std::to_string(sides[k].face); };
    if (end - i == 1)
      open.found([&] { return where() + " belongs to face " + face(i) + " only: the surface is open"; });
    else if (end - i > 2)
      crowded.found([&] { return where() + " belongs to " + std::to_string(end - i) + " faces"; });
    else if (sides[i].forward == sides[i + 1].forward)
      same_way.found([&] {
        return "faces " + face(i) + " and " + face(i + 1) + " are oriented against each other along " +
               where();
      });
  }
  open.report(report.defects, "close the hole in the modeller");
  crowded.report(report.defects, "a solid has two faces at every edge: split or remove the extra ones");
  same_way.report(report.defects, "make all faces counter-clockwise seen from outside");
  report.closed = !open.any() && !crowded.any();
  report.consistent = !same_way.any();
}

/// Every edge has two faces here, so the faces around a vertex form rings: the face that leaves the vertex
/// towards n is followed by the one that comes in from n. A vertex with more than one ring joins parts of the
/// surface in a point.
void check_vertices(const PolygonSoup& soup, MeshReport& report) {
  struct Turn {
    std::size_t vertex, from, to;  ///< a face comes in from `from` and leaves towards `to`
  };
  std::vector<Turn> turns;
  for (const auto& face : soup.faces)
    for (std::size_t i = 0; i < face.size(); ++i)
      turns.push_back(
          {face[i], face[i > 0 ? i - 1 : face.size() - 1], face[i + 1 < face.size() ? i + 1 : 0]});
  const auto before = [](const Turn& a, const Turn& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : a.from < b.from;
  };
  std::sort(turns.begin(), turns.end(), before);
  Tally pinched;
  for (auto begin = turns.begin(); begin != turns.end();) {
    const auto end =
        std::find_if(begin, turns.end(), [&](const Turn& t) { return t.vertex != begin->vertex; });
    std::ptrdiff_t ring = 0;
    auto at = begin;
    do {
      at = std::lower_bound(begin, end, Turn{begin->vertex, at->to, 0}, before);
    } while (++ring < end - begin && at != begin);
    if (ring < end - begin)
      pinched.found([&] {
        return "parts of the surface meet only in vertex " + std::to_string(begin->vertex) + " at " +
               place(soup.vertices[begin->vertex]);
      });
    begin = end;
  }
  pinched.report(report.defects, "separate them in the modeller");
}

SurfaceMesh surface_mesh(const PolygonSoup& soup) {
  std::vector<Kernel::Point_3> points;
  points.reserve(soup.vertices.size());
  for (const Vector3d& p : soup.vertices) points.emplace_back(p.x(), p.y(), p.z());
  auto faces = soup.faces;
  PMP::remove_isolated_points_in_polygon_soup(points, faces);  // does_bound_a_volume() falls over them
  SurfaceMesh mesh;
  PMP::polygon_soup_to_polygon_mesh(points, faces, mesh);
  return mesh;
}

/// Cuts every face into triangles. Returns for each triangle its face's number in the file.
std::vector<std::size_t> triangulate(const PolygonSoup& soup, SurfaceMesh& mesh, MeshReport& report) {
  std::vector<std::size_t> face_of(soup.faces.size());
  Tally uncut;
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    face_of[f] = f;  // its first triangle keeps the number
    if (soup.faces[f].size() > 3 &&
        !PMP::triangulate_face(SurfaceMesh::Face_index(static_cast<std::uint32_t>(f)), mesh))
      uncut.found([&] {
        return face_name(f) + " near " + place(soup.vertices[soup.faces[f][0]]) +
               " cannot be cut into triangles";
      });
    face_of.resize(mesh.number_of_faces(), f);
  }
  uncut.report(report.defects, "make it flat, or cut it in the modeller");
  return face_of;
}

void check_self_intersection(const SurfaceMesh& mesh, const std::vector<std::size_t>& face_of,
                             MeshReport& report) {
  std::vector<std::pair<SurfaceMesh::Face_index, SurfaceMesh::Face_index>> pairs;
  PMP::self_intersections(mesh, std::back_inserter(pairs),
                          CGAL::parameters::maximum_number(kMostIntersections));
  report.self_intersecting = !pairs.empty();
  if (pairs.empty()) return;
  const auto corner = mesh.point(mesh.target(mesh.halfedge(pairs[0].first)));
  const std::size_t a = face_of[pairs[0].first], b = face_of[pairs[0].second];
  report.defects.push_back(
      (a == b ? "two halves of face " + std::to_string(a)
              : "faces " + std::to_string(a) + " and " + std::to_string(b)) +
      " near " + place({corner.x(), corner.y(), corner.z()}) + " cut through each other" +
      (pairs.size() < kMostIntersections ? also(pairs.size()) : " (1000 or more in all)") +
      "; unite the parts in the modeller");
}

void check_volume(const SurfaceMesh& mesh, MeshReport& report) {
  report.volume = CGAL::to_double(PMP::volume(mesh));
  report.outward = !report.self_intersecting && report.volume > 0.0 && PMP::does_bound_a_volume(mesh);
  if (report.outward || report.self_intersecting) return;
  report.defects.push_back(
      report.volume < 0.0
          ? "all faces look inwards (the volume is negative); flip the faces in the modeller"
          : "its shells do not bound a volume: one looks the wrong way, or nothing is inside; "
            "make outer shells look outwards and cavities inwards");
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

}  // namespace

MeshReport check_solid(const PolygonSoup& soup, TriangleMesh* triangles) {
  MeshReport report;
  report.vertices = soup.vertices.size();
  report.faces = soup.faces.size();
  report.volume = std::numeric_limits<double>::quiet_NaN();
  check_elements(soup, report.defects);
  if (!report.defects.empty()) return report;
  check_areas(soup, report.defects);
  check_edges(soup, report);
  if (!report.defects.empty()) return report;
  check_vertices(soup, report);
  if (!report.defects.empty()) return report;
  SurfaceMesh mesh = surface_mesh(soup);
  const std::vector<std::size_t> face_of = triangulate(soup, mesh, report);
  if (!report.defects.empty()) return report;
  check_self_intersection(mesh, face_of, report);
  check_volume(mesh, report);
  if (triangles != nullptr && report.solid()) *triangles = triangles_of(mesh);
  return report;
}

}  // namespace wrenchd
