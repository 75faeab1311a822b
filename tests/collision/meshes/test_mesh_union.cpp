// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_union.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_mesh_union {

using namespace wrenchd::test;

namespace {

/// An axis-parallel box with integer corners in a grid.
struct GridBox {
  std::array<int, 3> low{};
  std::array<int, 3> high{};
};

TriangleMesh mesh_of(const GridBox& box, const Matrix3d& R, double cell_m) {
  TriangleMesh mesh;
  for (unsigned i = 0; i < 8; ++i) {
    const Vector3d corner(i & 1 ? box.high[0] : box.low[0], i & 2 ? box.high[1] : box.low[1],
                          i & 4 ? box.high[2] : box.low[2]);
    mesh.vertices_m.push_back(cell_m * (R * corner));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// Returns the number of grid cells in the union.
std::size_t cells_of(const std::vector<GridBox>& boxes) {
  std::set<std::array<int, 3>> cells;
  for (const GridBox& box : boxes)
    for (int x = box.low[0]; x < box.high[0]; ++x)
      for (int y = box.low[1]; y < box.high[1]; ++y)
        for (int z = box.low[2]; z < box.high[2]; ++z) cells.insert({x, y, z});
  return cells.size();
}

double volume_m3(const TriangleMesh& mesh) {
  double six_V = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    six_V += mesh.vertices_m[a].dot(mesh.vertices_m[b].cross(mesh.vertices_m[c]));
  return six_V / 6.0;
}

std::vector<GridBox> random_boxes(RandomValues& random, int count, int grid) {
  std::vector<GridBox> boxes;
  for (int i = 0; i < count; ++i) {
    GridBox box;
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = random.integer(0, grid - 1);
      box.high[k] = box.low[k] + random.integer(1, 2);
    }
    boxes.push_back(box);
  }
  return boxes;
}

}  // namespace

TEST_CASE("the union of boxes that overlap has the volume of its cells", "[meshes]") {
  const double cell_m = 0.01;
  // Corners of the second box lie inside of the first one, so no faces touch.
  const std::vector<GridBox> boxes = {{{0, 0, 0}, {4, 4, 4}}, {{2, 2, 2}, {6, 6, 6}}, {{5, 5, 1}, {7, 9, 3}}};
  std::vector<TriangleMesh> parts;
  for (const GridBox& box : boxes) parts.push_back(mesh_of(box, Matrix3d::Identity(), cell_m));
  const UnitedMesh all = unite(parts);
  REQUIRE(all.united);
  CHECK(volume_m3(all.mesh) == Approx(static_cast<double>(cells_of(boxes)) * std::pow(cell_m, 3)));
}

// Parts of an assembly touch each other face to face, along edges and at corners, with rounded coordinates.
TEST_CASE("parts that touch in many places are one body or stay apart, and nothing crashes", "[meshes]") {
  RandomValues random(26);
  std::size_t united = 0, apart = 0;
  for (int run = 0; run < 300; ++run) {
    INFO("run " << run);
    const std::vector<GridBox> boxes = random_boxes(random, run % 4 < 2 ? 12 : 3, 5);
    const Matrix3d R = run % 3 == 0 ? Matrix3d(Matrix3d::Identity()) : random.rotation().toRotationMatrix();
    const double cell_m = run % 2 == 0 ? 0.01 : 0.01 / 25.4;
    std::vector<TriangleMesh> parts;
    for (const GridBox& box : boxes) parts.push_back(mesh_of(box, R, cell_m));
    const UnitedMesh all = unite(parts);
    if (all.united) {
      ++united;
      PolygonSoup soup{all.mesh.vertices_m, {}};
      for (const auto& [a, b, c] : all.mesh.triangles) soup.faces.push_back({a, b, c});
      CHECK(check_solid(soup).solid());
      CHECK(volume_m3(all.mesh) ==
            Approx(static_cast<double>(cells_of(boxes)) * std::pow(cell_m, 3)).epsilon(1e-9));
    } else {
      ++apart;
      CHECK(all.mesh.triangles.size() == 12 * boxes.size());
    }
  }
  CHECK(united > 0);
  CHECK(apart > 0);
}

}  // namespace wrenchd::test_mesh_union
