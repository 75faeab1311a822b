// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_repair.hpp"
#include "core/inertia.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/sample_meshes.hpp"

namespace wrenchd::test_mesh_repair {

namespace {

using namespace test;

const PolygonSoup kBox = box({0, 0, 0}, {2, 3, 5});
constexpr double kVolume = 30;

PolygonSoup soup_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return soup;
}

/// Repairs the soup and requires exactly these repairs. The result is a solid of this volume.
void check_repaired(PolygonSoup soup, const std::vector<std::string>& changes, double volume = kVolume) {
  CHECK(repair(soup) == changes);
  TriangleMesh mesh;
  const MeshReport report = check_solid(soup, &mesh);
  INFO((report.defects.empty() ? "" : report.defects[0]));
  REQUIRE(report.solid());
  CHECK(solid_properties(mesh, 1.0).volume_m3 == Approx(volume).epsilon(1e-5));
  CHECK(repair(soup).empty());  // a second repair changes nothing
}

TEST_CASE("a good mesh is left as it is", "[mesh_repair]") {
  for (const PolygonSoup& good :
       {kBox, triangulated(kBox), concatenated(kBox, inside_out(box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}))),
        soup_of(make_mesh({"gear", 2000}))}) {
    PolygonSoup soup = good;
    CHECK(repair(soup).empty());
    CHECK(soup.vertices == good.vertices);
    CHECK(soup.faces == good.faces);
    CHECK(soup.face_in_file(3) == 3);
  }
}

TEST_CASE("unused points are removed", "[mesh_repair]") {
  PolygonSoup soup = kBox;
  soup.vertices.insert(soup.vertices.begin() + 1, Vector3d(1000, 0, 0));
  soup.vertices.emplace_back(0, 1000, 0);
  for (auto& face : soup.faces)
    for (std::size_t& v : face) v += v > 0 ? 1 : 0;
  check_repaired(soup, {"removed 2 points that no face uses, first vertex 1 at (1000, 0, 0)"});
  repair(soup);
  CHECK(soup.vertices == kBox.vertices);
  CHECK(soup.vertex_in_file(1) == 2);
}

TEST_CASE("points at the same place are merged", "[mesh_repair]") {
  PolygonSoup soup{{}, {}};  // every face has its own corners, as in STL
  for (const auto& face : kBox.faces) {
    soup.faces.emplace_back();
    for (const std::size_t v : face) {
      soup.faces.back().push_back(soup.vertices.size());
      soup.vertices.push_back(kBox.vertices[v]);
    }
  }
  check_repaired(soup, {"merged 16 duplicate points, first vertex 8 at (0, 0, 0)"});
}

TEST_CASE("repeated corners and faces of two corners are removed", "[mesh_repair]") {
  PolygonSoup soup = kBox;
  soup.faces[2] = {0, 1, 1, 5, 4, 0};
  check_repaired(soup, {"removed repeated corners of 1 face: face 2 near (0, 0, 0)"});
  soup = kBox;
  soup.faces.insert(soup.faces.begin() + 1, {0, 1});
  soup.faces.push_back({3, 3, 3});
  soup.faces.push_back({});
  check_repaired(soup,
                 {"removed 3 faces with fewer than three different corners, first face 1 near (0, 0, 0)"});
  repair(soup);
  CHECK(soup.face_in_file(0) == 0);
  CHECK(soup.face_in_file(1) == 2);
}

TEST_CASE("a face without area is removed and leaves no hole", "[mesh_repair]") {
  // A corner on an edge that only one of the two faces has: a cap fills the gap.
  PolygonSoup soup = triangulated(kBox);
  const auto edge = std::find(soup.faces.begin(), soup.faces.end(), std::vector<std::size_t>{0, 1, 5});
  REQUIRE(edge != soup.faces.end());
  soup.vertices.emplace_back(1, 0, 0);
  *edge = {0, 8, 5};
  soup.faces.push_back({8, 1, 5});
  soup.faces.push_back({0, 1, 8});
  check_repaired(soup, {"removed 1 face without area: face 13 near (0, 0, 0)"});

  // Several corners on one edge, one cap on another.
  soup.vertices.emplace_back(0.5, 0, 0);
  *std::find(soup.faces.begin(), soup.faces.end(), std::vector<std::size_t>{0, 8, 5}) = {0, 9, 5};
  soup.faces.push_back({9, 8, 5});
  soup.faces.push_back({0, 8, 9});
  check_repaired(soup, {"removed 2 faces without area, first face 13 near (0, 0, 0)"});

  // A face attached to an edge, in both orientations.
  soup = triangulated(kBox);
  soup.vertices.emplace_back(1, 0, 0);
  soup.faces.push_back({0, 1, 8});
  soup.faces.push_back({8, 1, 0});
  check_repaired(soup, {"removed 2 duplicate faces, first face 12 near (0, 0, 0)"});
  soup.faces.pop_back();
  check_repaired(soup, {"removed 1 face without area: face 12 near (0, 0, 0)"});
}

TEST_CASE("an edge with four faces that are connected around both ends is split in its middle",
          "[mesh_repair]") {
  // Four boxes around a square hole, as one surface: two of its opposite vertical edges meet in one edge.
  // Built as the union of a U-shaped block and a block that touches it along an edge only.
  PolygonSoup soup;
  const auto add = [&](const Vector3d& low, const Vector3d& high) {
    soup = concatenated(soup, box(low, high));
  };
  add({0, 0, 0}, {1, 1, 1});
  add({1, 1, 0}, {2, 2, 1});   // touches the first box along the edge x = y = 1
  add({0, 0, -1}, {1, 1, 0});  // below the first one
  add({1, 0, -1}, {2, 1, 0});
  add({1, 1, -1}, {2, 2, 0});  // below the second one: connects both
  add({0, 0, 1}, {1, 1, 2});   // and the same above
  add({1, 0, 1}, {2, 1, 2});
  add({1, 1, 1}, {2, 2, 2});
  const std::vector<std::string> changes = repair(soup);
  REQUIRE_FALSE(changes.empty());
  CHECK(changes.back().find("the edge at (1, 1, 0.5)") != std::string::npos);
  const MeshReport report = check_solid(soup);
  INFO((report.defects.empty() ? "" : report.defects[0]));
  CHECK(report.solid());
  CHECK(report.volume == Approx(8));
}

TEST_CASE("the wall between two solids that touch is removed", "[mesh_repair]") {
  const PolygonSoup beside = box({2, 0, 0}, {4, 3, 5});
  for (const bool triangles : {false, true}) {
    PolygonSoup soup = concatenated(kBox, beside);
    std::string what = "removed 2 duplicate faces, first face 1 near (2, 0, 0)";
    if (triangles) {
      // Both boxes divide the wall by the same diagonal.
      std::erase(soup.faces, std::vector<std::size_t>{1, 3, 7, 5});
      std::erase(soup.faces, std::vector<std::size_t>{8, 12, 14, 10});
      for (const auto& face :
           std::vector<std::vector<std::size_t>>{{1, 3, 7}, {1, 7, 5}, {8, 14, 10}, {8, 12, 14}})
        soup.faces.push_back(face);
      what = "removed 4 duplicate faces, first face 10 near (2, 0, 0)";
    }
    check_repaired(soup, {"merged 4 duplicate points, first vertex 8 at (2, 0, 0)", what}, 60);
  }
}

TEST_CASE("a needle is closed", "[mesh_repair]") {
  // Corner 0 is split into two nearby points, with two needles between them.
  PolygonSoup soup = triangulated(kBox);
  soup.vertices.emplace_back(1e-12, 0, 0);
  std::size_t count = 0;
  for (auto& face : soup.faces)
    for (std::size_t& v : face)
      if (v == 0 && count++ < 2) v = 8;
  // All cracks are closed: the two parts are one.
  repair(soup);
  CHECK(check_solid(soup).solid());
  CHECK(soup.vertices.size() == 8);
}

TEST_CASE("of duplicate faces one is kept, whatever their orientation", "[mesh_repair]") {
  PolygonSoup soup = kBox;
  soup.faces.push_back({7, 3, 2, 6});
  check_repaired(soup, {"removed 1 duplicate face: face 6 near (2, 3, 5)"});
  soup.faces.push_back({4, 6, 7, 5});
  check_repaired(soup, {"removed 2 duplicate faces, first face 6 near (2, 3, 5)"});
  soup = kBox;  // all faces twice
  for (const auto& face : kBox.faces) soup.faces.push_back(face);
  check_repaired(soup, {"removed 6 duplicate faces, first face 6 near (0, 0, 0)"});
  soup = kBox;  // with an inner copy
  for (const auto& face : inside_out(kBox).faces) soup.faces.push_back(face);
  check_repaired(soup, {"removed 6 duplicate faces, first face 6 near (0, 3, 0)"});
}

TEST_CASE("cracks of single precision are closed, wider ones are not", "[mesh_repair]") {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    PolygonSoup soup = triangulated(kBox);
    RandomValues random(3);
    PolygonSoup torn{{}, {}};
    const auto tear = [&](double width) {
      torn = {{}, {}};
      for (const auto& face : soup.faces) {
        torn.faces.emplace_back();
        for (const std::size_t v : face) {
          torn.faces.back().push_back(torn.vertices.size());
          torn.vertices.push_back(scale * (soup.vertices[v] + width * random.unit<3>()));
        }
      }
    };
    tear(1e-7);
    const std::vector<std::string> changes = repair(torn);
    REQUIRE(changes.size() == 1);
    CHECK(changes[0].find("merged 28 points along cracks no wider than single precision, first (") == 0);
    CHECK(check_solid(torn).solid());
    CHECK(check_solid(torn).volume == Approx(kVolume * std::pow(scale, 3)).epsilon(1e-5));
    tear(1e-4);
    repair(torn);
    CHECK_FALSE(check_solid(torn).closed);
  }
}

TEST_CASE("faces with the wrong orientation are flipped", "[mesh_repair]") {
  PolygonSoup soup = kBox;
  std::reverse(soup.faces[3].begin(), soup.faces[3].end());
  check_repaired(soup, {"flipped 1 face: face 3 near (2, 3, 0)"});
  const PolygonSoup gear = soup_of(make_mesh({"gear", 2000}));
  const double volume = check_solid(gear).volume;
  RandomValues random(1);
  for (const double share : {0.01, 0.3, 0.9}) {
    PolygonSoup some = gear;
    for (auto& face : some.faces)
      if (random.chance(share)) std::reverse(face.begin(), face.end());
    CHECK(repair(some).size() == 1);
    CHECK(check_solid(some).solid());
    CHECK(check_solid(some).volume == Approx(volume));
  }
}

TEST_CASE("a solid that is inside out is flipped, with its cavities", "[mesh_repair]") {
  const PolygonSoup cavity = inside_out(box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}));
  const PolygonSoup beside = box({10, 0, 0}, {11, 1, 1});
  check_repaired(inside_out(kBox), {"flipped 6 faces, first face 0 near (0, 3, 0)"});
  check_repaired(inside_out(concatenated(kBox, cavity)), {"flipped 12 faces, first face 0 near (0, 3, 0)"},
                 kVolume - 1);
  check_repaired(concatenated(inside_out(kBox), beside), {"flipped 6 faces, first face 0 near (0, 3, 0)"},
                 kVolume + 1);
  check_repaired(concatenated(concatenated(kBox, cavity), inside_out(beside)),
                 {"flipped 6 faces, first face 12 near (10, 1, 0)"}, kVolume);
}

TEST_CASE("faces without area that lie on each other are removed until none is left", "[mesh_repair]") {
  // A side of the box is divided at several points; the strip between the two divisions has no area. Its
  // triangles are neighbours of each other only.
  PolygonSoup soup = triangulated(kBox);
  for (const int count : {2, 3, 8}) {
    PolygonSoup some = soup;
    std::vector<std::size_t> on_edge = {0};
    for (int i = 1; i < count; ++i) {
      on_edge.push_back(some.vertices.size());
      some.vertices.emplace_back(2.0 * i / count, 0, 0);
    }
    on_edge.push_back(1);
    std::size_t flat = 0;
    for (auto& face : std::vector(some.faces)) {
      const auto at = std::find(face.begin(), face.end(), std::size_t{0});
      if (at == face.end() || face[static_cast<std::size_t>(at - face.begin() + 1) % 3] != 1) continue;
      // The face with the side from 0 to 1 is divided; the other one keeps the whole side.
      const std::size_t apex = face[static_cast<std::size_t>(at - face.begin() + 2) % 3];
      std::erase(some.faces, face);
      for (std::size_t i = 0; i + 1 < on_edge.size(); ++i)
        some.faces.push_back({on_edge[i], on_edge[i + 1], apex});
      // A fan from the end of the side fills the gap.
      for (std::size_t i = 0; i + 2 < on_edge.size(); ++i, ++flat)
        some.faces.push_back({on_edge[i], 1, on_edge[i + 1]});
      break;
    }
    REQUIRE(flat == static_cast<std::size_t>(count - 1));
    const std::vector<std::string> changes = repair(some);
    REQUIRE(changes.size() == 1);
    CHECK(changes[0].find("removed " + std::to_string(flat) + " face") == 0);
    const MeshReport report = check_solid(some);
    INFO((report.defects.empty() ? "" : report.defects[0]));
    CHECK(report.solid());
    CHECK(report.volume == Approx(kVolume));
  }
}

TEST_CASE("a leaf of two faces without area disappears", "[mesh_repair]") {
  PolygonSoup soup = triangulated(kBox);
  soup.vertices.emplace_back(0.7, 0, 0);  // on the side from 0 to 1
  soup.vertices.emplace_back(1.4, 0, 0);
  soup.faces.push_back({8, 1, 9});
  soup.faces.push_back({9, 1, 8});
  soup.faces.push_back({0, 9, 8});
  soup.faces.push_back({8, 9, 0});
  repair(soup);
  const MeshReport report = check_solid(soup);
  INFO((report.defects.empty() ? "" : report.defects[0]));
  CHECK(report.solid());
  CHECK(report.volume == Approx(kVolume));
}

TEST_CASE("parts joined in a point or an edge are split", "[mesh_repair]") {
  PolygonSoup point = concatenated(kBox, box({2, 3, 5}, {4, 4, 6}));
  for (auto& face : point.faces)
    for (std::size_t& v : face) v = v == 8 ? 7 : v;
  PolygonSoup edge = concatenated(kBox, box({2, -3, 0}, {4, 0, 5}));
  for (auto& face : edge.faces)
    for (std::size_t& v : face) v = v == 8 + 2 ? 1 : v == 8 + 6 ? 5 : v;
  for (PolygonSoup* soup : {&point, &edge}) {
    CHECK_FALSE(check_solid(*soup).solid());
    const std::vector<std::string> changes = repair(*soup);
    REQUIRE_FALSE(changes.empty());
    CHECK(changes.back().find("split ") == 0);
    const MeshReport report = check_solid(*soup);
    INFO((report.defects.empty() ? "" : report.defects[0]));
    CHECK(report.solid());
    CHECK(report.volume == Approx(soup == &point ? 32 : 60));
    CHECK(solid_shells(*soup).size() == 2);  // each box is one part
  }
}

TEST_CASE("a defect that needs a guess is left unchanged", "[mesh_repair]") {
  const auto left = [](PolygonSoup soup) {
    CHECK(repair(soup).empty());
    return !check_solid(soup).solid();
  };
  PolygonSoup hole = kBox;
  hole.faces.pop_back();
  CHECK(left(hole));
  CHECK(left(concatenated(kBox, box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}))));  // a cavity, or a body in a body
  CHECK(left(concatenated(kBox, box({1, 1, 1}, {3, 2, 2}))));
  PolygonSoup fin = triangulated(kBox);
  fin.vertices.emplace_back(1, -1, 0);
  fin.faces.push_back({0, 1, 8});
  CHECK(left(fin));
  PolygonSoup bow = kBox;
  bow.faces[0] = {0, 4, 6, 4};
  CHECK(left(bow));
  PolygonSoup no_number = kBox;
  no_number.vertices[0].x() = std::numeric_limits<double>::quiet_NaN();
  CHECK(left(no_number));
  PolygonSoup out_of_range = kBox;
  out_of_range.faces[0][0] = 8;
  CHECK(left(out_of_range));
  CHECK(left({}));
  // A Moebius band has one side.
  PolygonSoup band;
  for (std::size_t i = 0; i < 12; ++i) {
    const double rotation = std::numbers::pi * static_cast<double>(i) / 12, around = 2 * rotation;
    const Vector3d out(std::cos(around), std::sin(around), 0);
    for (const double side : {-0.2, 0.2})
      band.vertices.push_back(out +
                              side * (std::cos(rotation) * out + std::sin(rotation) * Vector3d::UnitZ()));
    const std::size_t a = 2 * i, b = i < 11 ? a + 2 : 1, c = i < 11 ? a + 3 : 0;
    band.faces.push_back({a, b, c, a + 1});
  }
  CHECK(left(band));
}

}  // namespace
}  // namespace wrenchd::test_mesh_repair
