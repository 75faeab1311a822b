// SPDX-License-Identifier: GPL-3.0-or-later
#include <sstream>

#include <catch2/catch.hpp>

#include "collision/mesh_check.hpp"
#include "core/inertia.hpp"
#include "tools/make_mesh.hpp"

namespace wrenchd {
namespace {

PolygonSoup soup_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return soup;
}

TEST_CASE("every kind of mesh that can be made is a solid of about as many triangles as wanted",
          "[make_mesh]") {
  for (const MeshKind& kind : mesh_kinds())
    for (const std::size_t triangles : {400, 3000, 20000}) {
      INFO(kind.name << ' ' << triangles);
      const TriangleMesh mesh = make_mesh({kind.name, triangles});
      const MeshReport report = check_solid(soup_of(mesh));
      CHECK(report.solid());
      for (const std::string& defect : report.defects) UNSCOPED_INFO(defect);
      CHECK(static_cast<double>(mesh.triangles.size()) ==
            Approx(static_cast<double>(triangles)).epsilon(0.5));
    }
}

TEST_CASE("made meshes have the measures that are said of them", "[make_mesh]") {
  const auto volume = [](const char* kind) {
    return solid_properties(make_mesh({kind, 50000}), 1.0).volume_m3;
  };
  CHECK(volume("cube") == Approx(0.05 * 0.05 * 0.05));
  CHECK(volume("plate") == Approx(0.1 * 0.1 * 0.001));
  CHECK(volume("sphere") == Approx(4.0 / 3.0 * 3.14159265 * 0.03 * 0.03 * 0.03).epsilon(1e-3));
  CHECK(volume("peg") == Approx(3.14159265 * 0.0098 * 0.0098 * 0.06).epsilon(1e-3));
  CHECK(volume("hole") == Approx(3.14159265 * (0.02 * 0.02 - 0.01 * 0.01) * 0.08).epsilon(2e-3));
}

TEST_CASE("a mesh that nobody knows is refused by its name", "[make_mesh]") {
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
}  // namespace wrenchd
