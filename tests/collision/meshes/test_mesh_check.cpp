// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "core/inertia.hpp"
#include "tests/support/sample_meshes.hpp"

namespace wrenchd::test_mesh_check {

namespace {

using namespace test;

const PolygonSoup kBox = box({0, 0, 0}, {2, 3, 5});

std::string defects(const PolygonSoup& soup) {
  TriangleMesh mesh;
  const MeshReport report = check_solid(soup, &mesh);
  CHECK(mesh.triangles.empty() != report.solid());
  std::string text;
  for (const std::string& defect : report.defects) text += defect + "\n";
  return text;
}

/// Requires exactly these defects, one per line.
void check_defects(const PolygonSoup& soup, const std::vector<std::string>& expected) {
  std::string text;
  for (const std::string& defect : expected) text += defect + "\n";
  CHECK(defects(soup) == text);
}

/// Requires one defect that contains all of these words.
void check_defect_with(const PolygonSoup& soup, const std::vector<std::string>& words) {
  const std::string text = defects(soup);
  INFO(text);
  CHECK(std::count(text.begin(), text.end(), '\n') == 1);
  for (const std::string& word : words) CHECK(text.find(word) != std::string::npos);
}

void check_good(const PolygonSoup& soup, double volume) {
  TriangleMesh mesh;
  const MeshReport report = check_solid(soup, &mesh);
  INFO((report.defects.empty() ? "" : report.defects[0]));
  REQUIRE(report.solid());
  CHECK(report.closed);
  CHECK(report.consistent);
  CHECK(report.outward);
  CHECK_FALSE(report.self_intersecting);
  CHECK(report.volume == Approx(volume).epsilon(1e-12));
  CHECK(solid_properties(mesh, 1.0).volume_m3 == Approx(volume).epsilon(1e-12));
}

TEST_CASE("a closed box is a solid") {
  check_good(kBox, 30);
  check_good(triangulated(kBox), 30);
  const MeshReport report = check_solid(kBox);
  CHECK(report.vertices == 8);
  CHECK(report.faces == 6);
}

TEST_CASE("a solid may have concave faces, corners on an edge, several shells and cavities") {
  // An L of three unit squares, of height two.
  PolygonSoup ell{{}, {{5, 4, 3, 2, 1, 0}, {6, 7, 8, 9, 10, 11}}};
  for (const double z : {0.0, 2.0})
    for (const auto& [x, y] : {std::pair{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}})
      ell.vertices.emplace_back(x, y, z);
  for (std::size_t i = 0; i < 6; ++i) ell.faces.push_back({i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6});
  check_good(ell, 6);

  // A vertex half-way along the edge from 0 to 1, in both faces at the edge.
  PolygonSoup corner = kBox;
  corner.vertices.emplace_back(1, 0, 0);
  corner.faces[2] = {0, 8, 1, 5, 4};
  corner.faces[4] = {0, 2, 3, 1, 8};
  check_good(corner, 30);

  check_good(concatenated(kBox, box({10, 0, 0}, {11, 1, 1})), 31);
  check_good(concatenated(kBox, inside_out(box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}))), 29);
  check_good(concatenated(concatenated(kBox, inside_out(box({0.5, 0.5, 0.5}, {1.5, 2.5, 4.5}))),
                          box({0.9, 0.9, 0.9}, {1.1, 1.1, 1.1})),
             30 - 8 + 0.008);
}

TEST_CASE("a quad that is not planar is triangulated") {
  PolygonSoup soup = kBox;
  soup.vertices[7] += Vector3d(0.1, 0.2, 0.3);
  TriangleMesh mesh;
  const MeshReport report = check_solid(soup, &mesh);
  REQUIRE(report.solid());
  CHECK(mesh.triangles.size() == 12);
  CHECK(report.volume > 30);
}

TEST_CASE("a face of five corners that crosses itself is reported") {
  const PolygonSoup star{{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {3, 1, 0}, {1, 1, 3}},
                         {{0, 2, 1, 3, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}}};
  check_defect_with(star, {"face 0", "cannot be triangulated"});
}

TEST_CASE("vertices that no face uses do not count") {
  PolygonSoup soup = kBox;
  soup.vertices.insert(soup.vertices.begin(), Vector3d(1000, 0, 0));
  soup.vertices.emplace_back(0, 1000, 0);
  for (auto& face : soup.faces)
    for (std::size_t& v : face) ++v;
  check_good(soup, 30);
  TriangleMesh mesh;
  check_solid(soup, &mesh);
  CHECK(mesh.vertices_m.size() == 8);
}

TEST_CASE("scale and position of a solid do not matter") {
  for (const double scale : {1e-6, 1e-3, 1.0, 1e3, 1e6}) {
    for (const double offset : {0.0, 1e3}) {
      PolygonSoup soup = kBox;
      for (Vector3d& p : soup.vertices) p = scale * (p + Vector3d::Constant(offset));
      const MeshReport report = check_solid(soup);
      INFO(scale << " " << offset);
      CHECK(report.solid());
      CHECK(report.volume == Approx(30 * scale * scale * scale).epsilon(1e-6));
    }
  }
}

TEST_CASE("coordinates that are not finite are found") {
  PolygonSoup soup = kBox;
  soup.vertices[3].y() = std::numeric_limits<double>::quiet_NaN();
  check_defects(soup, {"vertex 3 is not a number: (2, nan, 0); export the mesh again"});
  soup.vertices[5].x() = -std::numeric_limits<double>::infinity();
  check_defects(soup, {"vertex 3 is not a number: (2, nan, 0) (2 in all); export the mesh again"});
}

TEST_CASE("faces that are no polygons are found") {
  PolygonSoup soup = kBox;
  soup.faces[1][2] = 8;
  check_defects(
      soup, {"face 1 uses vertex 8, but there are only 8; vertex numbers start at 0; export the mesh again"});

  soup = kBox;
  soup.faces[1][2] = static_cast<std::size_t>(-2);
  check_defects(
      soup,
      {"face 1 uses vertex -2, but there are only 8; vertex numbers start at 0; export the mesh again"});

  soup = kBox;
  soup.faces.push_back({0, 1});
  soup.faces.push_back({});
  check_defects(soup, {"face 6 has 2 vertices (2 in all); remove it"});

  soup = kBox;
  soup.faces[0] = {0, 4, 6, 4};
  check_defects(soup, {"face 0 uses a vertex twice; remove degenerate faces in the modeller"});

  // All defects are reported at once.
  soup.vertices[0].z() = std::numeric_limits<double>::infinity();
  soup.faces[5][0] = 100;
  CHECK(defects(soup).find("vertex 0 ") != std::string::npos);
  CHECK(defects(soup).find("face 5 ") != std::string::npos);
  CHECK(defects(soup).find("face 0 ") != std::string::npos);
}

TEST_CASE("a face without area is found") {
  PolygonSoup soup = triangulated(kBox);
  soup.vertices.emplace_back(1, 0, 0);  // on the edge from 0 to 1
  soup.faces.push_back({0, 1, 8});
  soup.faces.push_back({8, 1, 0});
  const std::string text = defects(soup);
  CHECK(text.find("face 12 near (0, 0, 0) has no area (2 in all); remove degenerate faces") == 0);
}

TEST_CASE("a hole is found") {
  PolygonSoup soup = kBox;
  soup.faces.erase(soup.faces.begin() + 5);  // z = 5
  check_defects(
      soup,
      {"the edge from (2, 0, 5) to (0, 0, 5) belongs to face 2 only: the surface is open (4 in all); close "
       "the hole in the modeller"});
  const MeshReport report = check_solid(soup);
  CHECK_FALSE(report.closed);
  CHECK(report.consistent);
  CHECK(std::isnan(report.volume));

  soup.faces.erase(soup.faces.begin() + 4);  // z = 0
  check_defect_with(soup, {"the surface is open (8 in all)"});
  check_defect_with({kBox.vertices, {kBox.faces[0]}}, {"belongs to face 0 only", "(4 in all)"});
}

TEST_CASE("a face with the wrong orientation is found") {
  PolygonSoup soup = kBox;
  std::reverse(soup.faces[0].begin(), soup.faces[0].end());
  check_defect_with(soup, {"faces 0 and ", "oriented against each other along the edge from (0, ",
                           "(4 in all)", "make all faces counter-clockwise seen from outside"});
  CHECK(check_solid(soup).closed);
  CHECK_FALSE(check_solid(soup).consistent);
}

TEST_CASE("a solid that is inside out is found") {
  check_defects(inside_out(kBox),
                {"all faces point inwards (the volume is negative); flip the faces in the modeller"});
  check_defect_with(concatenated(kBox, box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5})),
                    {"make outer shells face outwards and cavities inwards"});
  check_defect_with(concatenated(kBox, inside_out(box({10, 0, 0}, {11, 1, 1}))),
                    {"make outer shells face outwards"});
  check_defect_with(concatenated(inside_out(kBox), inside_out(box({10, 0, 0}, {11, 1, 1}))),
                    {"all faces point inwards"});
}

TEST_CASE("an edge with more than two faces is found") {
  PolygonSoup fin = triangulated(kBox);
  fin.vertices.emplace_back(1, -1, 0);
  fin.faces.push_back({0, 1, 8});
  const std::string text = defects(fin);
  CHECK(text.find(
            "the edge from (0, 0, 0) to (2, 0, 0) belongs to 3 faces; a solid has two faces at every edge") !=
        std::string::npos);
  CHECK(text.find("belongs to face 12 only") != std::string::npos);

  // Two boxes that share the edge from vertex 1 to 5 (x = 2, y = 0).
  PolygonSoup edge = concatenated(kBox, box({2, -3, 0}, {4, 0, 5}));
  for (auto& face : edge.faces)
    for (std::size_t& v : face) v = v == 8 + 2 ? 1 : v == 8 + 6 ? 5 : v;
  check_defect_with(edge, {"the edge from (2, 0, 0) to (2, 0, 5) belongs to 4 faces"});
  CHECK_FALSE(check_solid(edge).closed);

  PolygonSoup twice = kBox;
  twice.faces.push_back(twice.faces[3]);
  check_defect_with(twice, {"belongs to 3 faces (4 in all)"});
}

TEST_CASE("parts that meet in one vertex are found") {
  PolygonSoup soup = concatenated(kBox, box({2, 3, 5}, {4, 4, 6}));
  for (auto& face : soup.faces)
    for (std::size_t& v : face) v = v == 8 ? 7 : v;
  check_defects(
      soup, {"parts of the surface are joined only in vertex 7 at (2, 3, 5); separate them in the modeller"});
  // The same with two vertices in the file: the surfaces touch, which is tolerated.
  CHECK(check_solid(concatenated(kBox, box({2, 3, 5}, {4, 4, 6}))).solid());
}

TEST_CASE("faces that intersect each other are found") {
  const PolygonSoup soup = concatenated(kBox, box({1, 1, 1}, {3, 2, 2}));
  check_defect_with(soup, {" near (", "intersect each other", " in all); unite the parts in the modeller"});
  CHECK(check_solid(soup).self_intersecting);
  // A spike through the lid only. The numbers are those of the file, not those of the triangles.
  const PolygonSoup spike{{{1, 1, 6}, {1.5, 1, 6}, {1, 1.5, 6}, {1.1, 1.1, 4}},
                          {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}}};
  REQUIRE(check_solid(spike).solid());
  check_defect_with(concatenated(kBox, spike), {"faces 5 and ", "intersect each other"});
  check_defect_with(concatenated(kBox, kBox), {"intersect each other"});
  // Each pair of faces only touches, because four sides of the two boxes are coplanar.
  check_defect_with(concatenated(kBox, box({1, 0, 0}, {4, 3, 5})), {"intersect each other"});
}

TEST_CASE("parts that overlap by less than 1e-5 of the mesh are tolerated, and the overlap is reported") {
  const double diagonal = Vector3d(4, 3, 5).norm();
  const auto overlapping = [&](double overlap) {
    return concatenated(kBox, box({2 - overlap * diagonal, 0.5, 0.5}, {4, 2.5, 4.5}));
  };
  for (const double overlap : {0.0, 1e-9, 9e-6}) {
    TriangleMesh mesh;
    const MeshReport report = check_solid(overlapping(overlap), &mesh);
    INFO(overlap << (report.defects.empty() ? "" : report.defects[0]));
    REQUIRE(report.solid());
    CHECK(report.outward);
    CHECK_FALSE(report.self_intersecting);
    CHECK(report.tolerated.find(" overlap (") != std::string::npos);
    CHECK(report.tolerated.find("of the diagonal of the mesh") != std::string::npos);
    CHECK(mesh.triangles.size() == 24);
    CHECK(report.volume == Approx(30 + 16).epsilon(1e-3));
  }
  CHECK_FALSE(check_solid(overlapping(2e-5)).solid());
  CHECK(check_solid(kBox).tolerated.empty());
}

TEST_CASE("a fold of one shell is tolerated if it is small, and else rejected with a cure that fits") {
  PolygonSoup soup = triangulated(kBox);
  // A dimple of the lid: its tip is pushed through the floor, or just touches it.
  const std::size_t tip = soup.vertices.size();
  soup.vertices.emplace_back(1, 1.5, 0);
  std::erase_if(soup.faces, [&](const auto& face) {
    return std::all_of(face.begin(), face.end(), [](std::size_t v) { return v >= 4; });
  });
  for (const auto& [a, b] : {std::pair<std::size_t, std::size_t>{4, 5}, {5, 7}, {7, 6}, {6, 4}})
    soup.faces.push_back({a, b, tip});
  CHECK(check_solid(soup).solid());
  soup.vertices[tip].z() = -1e-5;
  CHECK(check_solid(soup).tolerated.find("overlap") != std::string::npos);
  soup.vertices[tip].z() = -1;
  check_defect_with(soup, {"intersect each other", "use the file with kind = \"surface\""});
  // A second part does not make the first one a solid, so a list of parts is no remedy.
  check_defect_with(concatenated(soup, box({1.5, 2, 2}, {4, 4, 4})),
                    {"use the file with kind = \"surface\""});
}

TEST_CASE("the shells of a soup are solids of their own, unless one is a cavity") {
  CHECK(solid_shells(concatenated(kBox, box({1, 1, 1}, {3, 2, 2}))).size() == 2);
  CHECK(solid_shells(kBox).size() == 1);
  CHECK(solid_shells(concatenated(kBox, inside_out(box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5})))).empty());
}

TEST_CASE("a mesh in which everything intersects is rejected quickly") {
  PolygonSoup soup;
  for (int i = 0; i < 300; ++i)
    soup = concatenated(soup, box(Vector3d::Constant(1e-4 * i), Vector3d::Constant(1 + 1e-4 * i)));
  check_defect_with(soup, {"intersect each other (20000 or more in all)"});
}

TEST_CASE("a face that cannot be triangulated is found") {
  PolygonSoup soup = box({0, 0, 0}, {1, 1, 1});
  for (Vector3d& p : soup.vertices) p *= 1e110;  // the plane of a face cannot be computed beyond this
  check_defect_with(soup, {"face 0 near (0, 0, 0) cannot be triangulated (6 in all); make it planar"});
}

TEST_CASE("a surface may be open, one-sided and self-intersecting, but needs finite coordinates and areas") {
  const auto triangles_of = [](const PolygonSoup& soup) {
    TriangleMesh mesh;
    const MeshReport report = check_surface(soup, &mesh);
    CHECK(report.defects.empty());
    CHECK(mesh.vertices_m == soup.vertices);
    return mesh.triangles.size();
  };
  CHECK(triangles_of(kBox) == 12);
  CHECK(triangles_of(inside_out(kBox)) == 12);
  CHECK(triangles_of({kBox.vertices, {kBox.faces[0], kBox.faces[3]}}) == 4);
  CHECK(triangles_of(concatenated(kBox, box({1, 1, 1}, {3, 2, 2}))) == 24);
  PolygonSoup fin = triangulated(kBox);
  fin.vertices.emplace_back(1, -1, 0);
  fin.faces.push_back({0, 1, 8});
  fin.faces.push_back({0, 1, 8});
  CHECK(triangles_of(fin) == 14);

  const auto refused_with = [](const PolygonSoup& soup, const std::string& words) {
    TriangleMesh mesh;
    const MeshReport report = check_surface(soup, &mesh);
    CHECK(mesh.triangles.empty());
    REQUIRE(report.defects.size() == 1);
    CHECK(report.defects[0].find(words) != std::string::npos);
  };
  PolygonSoup bad = kBox;
  bad.vertices[2].x() = std::numeric_limits<double>::quiet_NaN();
  refused_with(bad, "vertex 2 is not a number");
  bad = kBox;
  bad.faces[4][1] = 9;
  refused_with(bad, "face 4 uses vertex 9");
  bad = kBox;
  bad.vertices.emplace_back(1, 0, 0);
  bad.faces.push_back({0, 1, 8});
  refused_with(bad, "face 6 near (0, 0, 0) has no area");
  refused_with({kBox.vertices, {}}, "no face that has an area");
}

TEST_CASE("a surface of which the repair leaves nothing is rejected") {
  PolygonSoup far = triangulated(kBox);
  far.vertices[5].x() = 1e126;  // relative to this point all others coincide
  TriangleMesh mesh;
  const MeshReport report = repair_and_check_surface(far, &mesh);
  CHECK(mesh.triangles.empty());
  REQUIRE(report.defects.size() == 1);
  CHECK(report.defects[0].find("a vertex that is much too far away") != std::string::npos);
}

TEST_CASE("a mesh without an inside is rejected") {
  CHECK_FALSE(check_solid({}).solid());
  CHECK_FALSE(check_solid({kBox.vertices, {}}).solid());
  const PolygonSoup leaf{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {2, 1, 0}}};
  CHECK_FALSE(check_solid(leaf).solid());
  const PolygonSoup flat{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}},
                         {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
  CHECK_FALSE(check_solid(flat).solid());
}

TEST_CASE("coordinates at the end of their range cause no crash") {
  for (const double scale : {1e-320, 1e-200, 1e-110, 1e110, 1e200, 1e307}) {
    PolygonSoup soup = kBox;
    for (Vector3d& p : soup.vertices) p *= scale;
    const MeshReport report = check_solid(soup);
    INFO(scale);
    CHECK((report.solid() || !report.defects.empty()));
  }
}

}  // namespace
}  // namespace wrenchd::test_mesh_check
