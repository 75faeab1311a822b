// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_size.hpp"

namespace wrenchd::test_mesh_size {

namespace {

/// A cube of 50 mm.
const TriangleMesh& cube() {
  static const TriangleMesh mesh = make_mesh({"cube", 12});
  return mesh;
}

std::string question(double scale, PlausibleSize likely) {
  return implausible_size(cube(), scale, likely).value_or("");
}

TEST_CASE("an implausible size causes a question with the scale that corrects it", "[mesh_size]") {
  CHECK(question(1.0, kPlausibleToolSize) == "");
  CHECK(question(0.02, kPlausibleToolSize) == "");
  CHECK(question(40.0, kPlausibleToolSize) == "");
  CHECK(question(1000.0, kPlausibleToolSize) ==
        "its largest side is 50 m at scale 1e+03: were millimetres taken for metres? 'scale' would be 1");
  CHECK(question(0.001, kPlausibleToolSize) ==
        "its largest side is 5e-05 m at scale 0.001: were metres taken for millimetres? 'scale' would be 1");
  CHECK(question(1e-7, kPlausibleToolSize) ==
        "its largest side is 5e-09 m at scale 1e-07: give 'scale' in metres per mesh unit");
  CHECK(question(1000.0, kPlausibleObstacleSize) == "");
  CHECK(question(10000.0, kPlausibleObstacleSize).find("its largest side is 500 m") == 0);
}

TEST_CASE("a size outside the range of contact queries is rejected", "[mesh_size]") {
  const auto refused = [](const TriangleMesh& mesh, double scale) -> std::string {
    try {
      require_size_for_contacts(mesh, scale, "cube.off");
    } catch (const MeshError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refused(cube(), 1.0) == "");
  CHECK(refused(cube(), 1e-4) == "");
  CHECK(refused(cube(), 1e5) == "");
  for (const double scale : {1e-5, 1e-300, 1e6, 1e300, std::numeric_limits<double>::infinity()})
    CHECK(refused(cube(), scale).find("cube.off: its largest side is ") == 0);
  TriangleMesh far = cube();
  for (Vector3d& p : far.vertices_m) p.x() += 2e4;
  CHECK(refused(far, 1.0).find("cube.off: lies up to 20000 m from its own origin") == 0);
}

}  // namespace
}  // namespace wrenchd::test_mesh_size
