// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "core/inertia.hpp"
#include "tests/support/exact_intersection.hpp"

namespace wrenchd::test_make_mesh {

namespace {

PolygonSoup soup_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return soup;
}

TEST_CASE("every kind of mesh that can be made is a solid of about as many triangles as wanted",
          "[make_mesh]") {
  for (const MeshKind& kind : mesh_kinds())
    for (const std::size_t triangles : {1000, 3000, 20000}) {
      INFO(kind.name << ' ' << triangles);
      const TriangleMesh mesh = make_mesh({kind.name, triangles});
      const MeshReport report = check_solid(soup_of(mesh));
      CHECK(report.solid());
      for (const std::string& defect : report.defects) UNSCOPED_INFO(defect);
      CHECK(static_cast<double>(mesh.triangles.size()) ==
            Approx(static_cast<double>(triangles)).epsilon(0.5));
    }
}

TEST_CASE("generated meshes have the documented dimensions", "[make_mesh]") {
  const auto volume = [](const char* kind) {
    return solid_properties(make_mesh({kind, 50000}), 1.0).volume_m3;
  };
  CHECK(volume("cube") == Approx(0.05 * 0.05 * 0.05));
  CHECK(volume("plate") == Approx(0.1 * 0.1 * 0.001));
  CHECK(volume("sphere") == Approx(4.0 / 3.0 * 3.14159265 * 0.03 * 0.03 * 0.03).epsilon(1e-3));
  CHECK(volume("peg") == Approx(3.14159265 * 0.0098 * 0.0098 * 0.06).epsilon(1e-3));
  CHECK(volume("dowel") ==
        Approx(3.14159265 * 1e-9 * (9.9 * 9.9 * 56 + 4.0 / 3.0 * (9.9 * 9.9 + 9.9 * 7.9 + 7.9 * 7.9)))
            .epsilon(1e-3));
  CHECK(volume("ratchet") == Approx(3.14159265 * 1e-9 * (20 * 20 - 6 * 6) * 0.5 * (5.5 + 8)).epsilon(1e-3));
  CHECK(volume("hole") == Approx(3.14159265 * (0.02 * 0.02 - 0.01 * 0.01) * 0.08).epsilon(2e-3));
}

TEST_CASE("two ratchets fit face to face, and turn in one direction only", "[make_mesh]") {
  const TriangleMesh disc = make_mesh({"ratchet", 400});
  const test::ExactIntersection upper_in_lower(disc, disc);
  const auto overlap = [&](double turned_rad, double lifted_m) {
    const Quaterniond upside_down(0.0, 1.0, 0.0, 0.0);
    const Quaterniond turn(Eigen::AngleAxisd(turned_rad, Vector3d::UnitZ()));
    constexpr double kFitting_m = 0.0055 + 0.008;
    return upper_in_lower.intersect({turn * upside_down, {0.0, 0.0, kFitting_m + lifted_m}});
  };
  constexpr double kTurn_rad = 0.02, kClearance_m = 1e-5;
  constexpr double kRise_m = 0.0025 * kTurn_rad / (2.0 * 3.14159265 / 8.0);
  CHECK_FALSE(overlap(1e-4, kClearance_m));
  CHECK(overlap(0.0, -kClearance_m));
  // Forth, it rises along the ramps.
  CHECK(overlap(kTurn_rad, kRise_m - kClearance_m));
  CHECK_FALSE(overlap(kTurn_rad, kRise_m + kClearance_m));
  // Back, the walls meet.
  CHECK(overlap(-kTurn_rad, kRise_m + kClearance_m));
  CHECK_FALSE(overlap(-kTurn_rad, 0.0025 + kClearance_m));
}

TEST_CASE("a box has the requested sides", "[make_mesh]") {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : make_mesh({"box", 12, 1, {0.1, 0.02, 0.3}}).vertices_m) box.extend(p);
  CHECK((box.sizes() - Vector3d(0.1, 0.02, 0.3)).norm() < 1e-15);
}

TEST_CASE("the dowel has a clearance of 0.1 mm in its socket along its whole length", "[make_mesh]") {
  const auto radii = [](const TriangleMesh& mesh, double below_m) {
    std::vector<double> all;
    for (const Vector3d& p : mesh.vertices_m)
      if (std::abs(p.z()) < below_m && p.head<2>().norm() > 0.0) all.push_back(p.head<2>().norm());
    return all;
  };
  const auto peg = radii(make_mesh({"dowel", 4000}), 0.0281);
  const auto hole = radii(make_mesh({"socket", 4000}), 0.0251);
  CHECK(*std::max_element(peg.begin(), peg.end()) == Approx(0.0099));
  CHECK(*std::min_element(hole.begin(), hole.end()) == Approx(0.0100));
}

TEST_CASE("every ray from the hare's neck leaves it once, so that it cannot intersect itself",
          "[make_mesh]") {
  for (const std::size_t triangles : {2000, 20000}) {
    const TriangleMesh hare = make_mesh({"hare", triangles});
    double most = 0.0;
    Eigen::AlignedBox3d box;
    for (const auto& [a, b, c] : hare.triangles) {
      const Vector3d &p = hare.vertices_m[a], &q = hare.vertices_m[b], &r = hare.vertices_m[c];
      CHECK(p.normalized().cross(q.normalized()).dot(r.normalized()) > 0.0);
      most = std::max({most, (p - q).norm(), (q - r).norm(), (r - p).norm()});
    }
    for (const Vector3d& p : hare.vertices_m) box.extend(p);
    CHECK(box.sizes().z() == Approx(0.122).epsilon(0.03));
    if (triangles == 20000) CHECK(most < 0.015);
  }
}

TEST_CASE("every generated mesh has a name of its own", "[make_mesh]") {
  std::set<std::string> all;
  for (const GeneratedMesh& made : std::initializer_list<GeneratedMesh>{{"gear"},
                                                                        {"gear", 300},
                                                                        {"bumpy", 300},
                                                                        {"bumpy", 300, 2},
                                                                        {"box", 12},
                                                                        {"box", 12, 1, {0.1, 0.1, 0.1}}})
    all.insert(generated_mesh_name(made));
  CHECK(all.size() == 6);
  CHECK(all.count("made gear, 300 triangles") == 1);
}

TEST_CASE("an unknown kind of mesh is rejected with its name", "[make_mesh]") {
  CHECK_THROWS_WITH(make_mesh({"teapot"}), Catch::Contains("teapot"));
}

TEST_CASE("an OFF file reads back to the bit", "[make_mesh]") {
  const TriangleMesh mesh = make_mesh({"bumpy", 100});
  std::stringstream file;
  write_off(file, mesh);
  std::string head;
  std::size_t vertices = 0, faces = 0, edges = 0;
  file >> head >> vertices >> faces >> edges;
  REQUIRE(vertices == mesh.vertices_m.size());
  for (const Vector3d& p : mesh.vertices_m)
    for (int d = 0; d < 3; ++d) {
      double x = 0.0;
      file >> x;
      CHECK(x == p[d]);
    }
}

}  // namespace
}  // namespace wrenchd::test_make_mesh
