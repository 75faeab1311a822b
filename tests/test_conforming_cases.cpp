// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "core/inertia.hpp"
#include "tests/support/conforming_mesh.hpp"
#include "tests/support/conforming_scene.hpp"
#include "tests/support/contact_seeking_hand.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_conforming_cases {

using namespace test;

namespace {

/// One small case of each shape and profile.
std::vector<ConformingCase> small_cases() {
  using enum ConformingShape;
  std::vector<ConformingCase> all = {{"cube", cube_on_slab, 5000, 3000}, {"peg", peg_in_hole, 2000, 4000}};
  for (const Profile profile : {Profile::faceted, Profile::smooth})
    for (const auto shape : {shaft_in_bore, shaft_inserted, gears})
      for (const double clearance_m : {10e-6, 50e-6})
        all.push_back({"prism", shape, 6000, 4000, clearance_m, profile});
  return all;
}

MeshReport report_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return check_solid(soup);
}

TEST_CASE("the meshes of a conforming case are solids of equal shape", "[conforming]") {
  for (const ConformingCase& of : small_cases()) {
    INFO(of.name << ", shape " << static_cast<int>(of.shape) << ", profile " << static_cast<int>(of.profile));
    const MeshesOfCase fine = fine_meshes(of), coarse = coarse_meshes(of);
    const auto same_shape = [](const TriangleMesh& a, const TriangleMesh& b) {
      CHECK(report_of(a).solid());
      CHECK(report_of(b).solid());
      const SolidProperties of_a = solid_properties(a, 1.0), of_b = solid_properties(b, 1.0);
      CHECK(of_a.volume_m3 == Approx(of_b.volume_m3).epsilon(1e-12));
      CHECK((of_a.p_MT_m - of_b.p_MT_m).norm() < 1e-14);
      CHECK((of_a.inertia.H_kg_m2 - of_b.inertia.H_kg_m2).norm() < 1e-12 * of_b.inertia.H_kg_m2.norm());
    };
    same_shape(fine.tool, coarse.tool);
    same_shape(fine.obstacle, coarse.obstacle);
    const auto about = [](const TriangleMesh& mesh, std::size_t triangles) {
      CHECK(static_cast<double>(mesh.triangles.size()) ==
            Approx(static_cast<double>(triangles)).epsilon(0.35));
    };
    about(fine.tool, of.tool_triangles);
    about(fine.obstacle, of.obstacle_triangles);
  }
}

TEST_CASE("the clearance is that between the facets of shaft and bore", "[conforming]") {
  const auto gap_m = [](const MeshesOfCase& meshes) {
    double shaft_m = 0.0, bore_m = 1.0;
    for (const Vector3d& p : meshes.tool.vertices_m) shaft_m = std::max(shaft_m, p.head<2>().norm());
    for (const auto& t : meshes.obstacle.triangles) {  // the lines between neighbours around the bore
      const Vector3d &a = meshes.obstacle.vertices_m[t[0]], &b = meshes.obstacle.vertices_m[t[1]];
      bore_m = std::min(bore_m, (0.5 * (a + b)).head<2>().norm());
    }
    return bore_m - shaft_m;
  };
  for (const ConformingCase& of : small_cases())
    if (of.shape == ConformingShape::shaft_in_bore)
      CHECK(gap_m(coarse_meshes(of)) == Approx(of.clearance_m).epsilon(1e-9));
}

TEST_CASE("the hand of a conforming case starts free and keeps to 0.3 m/s and 3 rad/s", "[conforming]") {
  constexpr double kTick_s = 1e-3;
  for (const ConformingCase& of : small_cases()) {
    const MeshesOfCase coarse = coarse_meshes(of);
    const ExactIntersection exact(coarse.tool, coarse.obstacle);
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
      INFO("shape " << static_cast<int>(of.shape) << ", seed " << seed);
      const std::vector<Pose> X_WC = conforming_trajectory(of, 2200, seed);
      CHECK_FALSE(exact.intersect(X_WC.front()));
      double fastest_m_per_s = 0.0, fastest_rad_per_s = 0.0;
      for (std::size_t i = 1; i < X_WC.size(); ++i) {
        const Vector6d step = log(inverse(X_WC[i - 1]) * X_WC[i]);
        fastest_m_per_s =
            std::max(fastest_m_per_s, (X_WC[i].translation_m - X_WC[i - 1].translation_m).norm() / kTick_s);
        fastest_rad_per_s = std::max(fastest_rad_per_s, step.tail<3>().norm() / kTick_s);
      }
      CHECK(fastest_m_per_s < 0.3);
      CHECK(fastest_rad_per_s < 3.0);
    }
  }
}

TEST_CASE("a mesh in a file is rotated and rounded as a binary STL file", "[conforming]") {
  ConformingCase of = {"cube", ConformingShape::cube_on_slab, 1200, 12};
  of.in_float = of.rotated = true;
  const TriangleMesh mesh = mesh_in_file(of, fine_meshes(of).tool);
  for (const auto& t : mesh.triangles) {
    const Vector3d n = (mesh.vertices_m[t[1]] - mesh.vertices_m[t[0]])
                           .cross(mesh.vertices_m[t[2]] - mesh.vertices_m[t[0]])
                           .normalized();
    CHECK(n.cwiseAbs().maxCoeff() < 0.99);
    CHECK(n.cwiseAbs().minCoeff() > 0.01);
  }
  const TemporaryDirectory directory;
  const std::filesystem::path file = directory.path() / "cube.stl";
  {
    std::ofstream out(file, std::ios::binary);
    write_binary_stl(out, mesh);
  }
  const PolygonSoup read = parse_mesh(read_mesh_source(file));
  REQUIRE(read.faces.size() == mesh.triangles.size());
  CHECK(read.vertices.size() == mesh.vertices_m.size());
  for (std::size_t i = 0; i < read.faces.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(0.001 * read.vertices[read.faces[i][k]] == mesh.vertices_m[mesh.triangles[i][k]]);
}

TEST_CASE("a conforming scene puts the rotated meshes where the shapes are", "[conforming]") {
  ConformingCase of = {"gears", ConformingShape::gears, 2000, 2000, 0.0, Profile::faceted, true, true};
  MeshLoader loader;
  const ConformingScene loaded = load_scene(of, fine_meshes(of), loader);
  const ConformingScene coarse = load_coarse_scene(of);
  CHECK((inverse(loaded.X_TC).translation_m - inverse(coarse.X_TC).translation_m).norm() < 1e-8);
  const Pose X_WC = conforming_trajectory(of, 1).front();
  const Pose X_WP = body_poses(loaded, {X_WC}).front();
  const Pose X_CF = inverse(loaded.X_TC) * inverse(loaded.X_FT());
  const MeshesOfCase fine = fine_meshes(of);
  for (std::size_t i = 0; i < fine.tool.vertices_m.size(); ++i) {
    CHECK((X_CF * loaded.tool_F.vertices_m[i] - fine.tool.vertices_m[i]).norm() < 1e-8);
    CHECK((X_WP * inverse(loaded.X_FT()) * loaded.tool_F.vertices_m[i] - X_WC * fine.tool.vertices_m[i])
              .norm() < 1e-8);
  }
  for (std::size_t i = 0; i < fine.obstacle.vertices_m.size(); ++i)
    CHECK((loaded.X_WF * loaded.obstacle_F.vertices_m[i] - fine.obstacle.vertices_m[i]).norm() < 1e-8);
}

TEST_CASE("the exact test decides faces at rounding distance", "[conforming]") {
  const MeshesOfCase cubes = fine_meshes({"cube", ConformingShape::cube_on_slab, 48, 12});
  const ExactIntersection exact(cubes.tool, cubes.obstacle);
  const auto at = [](double gap_m) { return Pose{Quaterniond::Identity(), {0.0, 0.0, 0.025 + gap_m}}; };
  CHECK(exact.intersect(at(0.0)));
  CHECK(exact.intersect(at(-1e-9)));
  CHECK_FALSE(exact.intersect(at(1e-9)));
  CHECK_FALSE(exact.intersect(at(1e-16)));  // the least distance that the numbers resolve
}

TEST_CASE("the hand that seeks contact reaches the obstacle, within its speed and reach", "[conforming]") {
  const MeshesOfCase cubes = fine_meshes({"cube", ConformingShape::cube_on_slab, 48, 12});
  for (const auto approach : {ContactSeekingHand::Approach::faces, ContactSeekingHand::Approach::axis}) {
    ContactSeekingHand::Limits limits;
    limits.approach = approach;
    ContactSeekingHand hand(cubes.tool, cubes.obstacle, 1, limits);
    const ExactIntersection exact(cubes.tool, cubes.obstacle);
    CHECK_FALSE(exact.intersect(hand.start()));
    Pose X_WP = hand.start(), X_WQ = X_WP;
    int overlapping = 0;
    for (int i = 0; i < 6000; ++i) {
      const Pose last = X_WP;
      X_WP = hand.next(X_WQ);
      CHECK((X_WP.translation_m - last.translation_m).norm() < 1.001e-3 * limits.speed_m_per_s);
      CHECK(X_WP.rotation.angularDistance(last.rotation) < 1.001e-3 * limits.turn_rad_per_s);
      const bool overlaps = i % 20 == 0 && exact.intersect(X_WP);
      overlapping += overlaps ? 1 : 0;
      if (!exact.intersect(X_WP)) X_WQ = X_WP;
      CHECK((X_WP.translation_m - X_WQ.translation_m).norm() < limits.reach_m + 2e-3 * limits.speed_m_per_s);
    }
    CHECK(overlapping > 10);
  }
}

}  // namespace
}  // namespace wrenchd::test_conforming_cases
