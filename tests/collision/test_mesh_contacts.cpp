// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/mesh_contacts.hpp"
#include "collision/proxy.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_mesh_contacts {

namespace {

using namespace test;

constexpr double kClearance_m = 1e-9;

Scene two(TriangleMesh tool, TriangleMesh obstacle, Pose X_WO = {}) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"obstacle", MeshBvh(std::move(obstacle)), X_WO});
  return Scene(mesh_tool(std::move(tool)), {}, {}, std::move(obstacles));
}

MeshContacts::SweepResult sweep_between(const Scene& scene, const Pose& from, const Pose& to) {
  MeshContacts contacts(scene);
  contacts.set_start(from);
  VisitBudget budget = {1000000};
  return contacts.sweep(to, kClearance_m, budget);
}

Pose at(double x, double y, double z, const Vector3d& rotation = Vector3d::Zero()) {
  return {rotation_from(rotation), {x, y, z}};
}

TEST_CASE("a sweep of a cube meets a vertex, a face or an edge first", "[mesh_contacts]") {
  const Scene scene = two(make_mesh({"cube", 12}), make_mesh({"table", 12}));
  const Vector3d on_corner(0.6, 0.5, 0.0), on_edge(0.785398163, 0.0, 0.0);
  SECTION("a corner on a face") {
    const auto found = sweep_between(scene, at(0, 0, 0.06, on_corner), at(0, 0, 0.04, on_corner));
    REQUIRE(found.complete);
    REQUIRE(found.contacts.size() >= 1);
    CHECK(found.contacts[0].kind == ContactKind::vertex_face);
    CHECK(found.contacts[0].n_W.isApprox(Vector3d::UnitZ(), 1e-12));
    CHECK(gap_m(found.contacts[0], at(0, 0, 0.06, on_corner)) > 0.0);
    CHECK(gap_m(found.contacts[0], at(0, 0, 0.04, on_corner)) < 0.0);
  }
  SECTION("an edge over the table's edge") {
    const Vector3d across(0.785398163, 0.0, 0.0);  // the lowest edge runs along x
    const auto found = sweep_between(scene, at(0.15, 0, 0.06, across), at(0.15, 0, 0.04, across));
    REQUIRE(found.contacts.size() >= 1);
    bool edges = false;
    for (const Contact& c : found.contacts) edges = edges || c.kind == ContactKind::edge_edge;
    CHECK(edges);
    for (const Contact& c : found.contacts)
      CHECK(normal_W(c, at(0.15, 0, 0.06, across)).isApprox(Vector3d::UnitZ(), 1e-9));
  }
  SECTION("the other way round, the table's corner on a face") {
    const Scene other = two(make_mesh({"table", 12}), make_mesh({"cube", 12}), at(0, 0, 0, on_corner));
    const auto found = sweep_between(other, at(0, 0, 0.07), at(0, 0, 0.045));
    REQUIRE(found.contacts.size() >= 1);
    CHECK(found.contacts[0].kind == ContactKind::face_vertex);
    CHECK(normal_W(found.contacts[0], at(0, 0, 0.07)).isApprox(Vector3d::UnitZ(), 1e-9));
  }
  SECTION("nothing on a way that ends above") {
    const auto found = sweep_between(scene, at(0, 0, 0.06, on_edge), at(0.02, 0, 0.0456, on_edge));
    CHECK(found.contacts.empty());
    CHECK_FALSE(found.overlaps);
  }
  SECTION("a way through the whole table, in one step") {
    const auto found = sweep_between(scene, at(0, 0, 0.06), at(0.01, 0, -0.06));
    REQUIRE(found.contacts.size() >= 1);
    for (const Contact& c : found.contacts) CHECK(c.n_W.isApprox(Vector3d::UnitZ(), 1e-9));
  }
}

// No ghost contact: a cube that slides over a table meets nothing, at every triangulation of the table.
TEST_CASE("a sweep along a flat face meets nothing", "[mesh_contacts]") {
  for (const std::size_t triangles : {12, 1000, 20000}) {
    const Scene scene = two(make_mesh({"cube", triangles}), make_mesh({"table", triangles}));
    const double z = 0.035 + kClearance_m;
    const auto found = sweep_between(scene, at(0.001, 0.002, z), at(0.03, 0.0, z));
    INFO(triangles);
    CHECK(found.complete);
    CHECK(found.contacts.empty());
    CHECK_FALSE(found.overlaps);
  }
}

TEST_CASE("the touching contacts at the end of a sweep name their features", "[mesh_contacts]") {
  const Scene scene = two(make_mesh({"cube", 300}), make_mesh({"table", 300}));
  MeshContacts contacts(scene);
  VisitBudget budget = {1000000};
  contacts.set_start(at(0, 0, 0.036));
  const auto found = contacts.sweep(at(0, 0, 0.035 + kClearance_m), kClearance_m, budget);
  CHECK(found.contacts.empty());
  CHECK(contacts.touching().size() == 4);  // the corners, and no vertex inside the face
  for (const Contact& c : contacts.touching()) {
    CHECK(c.kind == ContactKind::vertex_face);
    CHECK(scene.tool_mesh()->surface.vertices_m()[c.tool_feature] == c.p_TCa_m);
    CHECK(scene.meshes()[0].mesh->surface.planar_region(c.obstacle_feature) == c.obstacle_feature);
    CHECK(c.obstacle == 0);
  }
}

TEST_CASE("a sheet has two sides and stops the tool on both", "[mesh_contacts]") {
  TriangleMesh sheet;
  sheet.vertices_m = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"sheet", MeshBvh(sheet, MeshSurface::Kind::surface), Pose{}});
  const Scene scene(mesh_tool(make_mesh({"cube", 12})), {}, {}, std::move(obstacles));
  for (const double side : {1.0, -1.0}) {
    const auto found = sweep_between(scene, at(0, 0, side * 0.04), at(0, 0, side * 0.01));
    REQUIRE(found.contacts.size() >= 1);
    for (const Contact& c : found.contacts) CHECK(c.n_W.isApprox(side * Vector3d::UnitZ(), 1e-12));
  }
}

// Steps in any direction from poses that the proxy reached, with and without contact.
TEST_CASE("a path that ends in an obstacle is never free", "[mesh_contacts]") {
  RandomValues random(12);
  for (const std::size_t i : {1, 5, 6, 8, 11, 13}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
    Proxy proxy(scene);
    MeshContacts contacts(scene);
    HandTrajectory hand(handling, 3);
    Pose X_WQ = {Quaterniond::Identity(), handling.start_m};
    int inside = 0;
    for (int n = 0; n < case_count(300); ++n) {
      for (int k = 0; k < 4; ++k) X_WQ = proxy.follow(hand.next(), X_WQ).X_WQ;
      const Pose X_WT = {(X_WQ.rotation * random.rotation(random.uniform(0.0, 0.05))).normalized(),
                         X_WQ.translation_m + random.log_uniform(1e-5, 0.02) * random.unit<3>()};
      contacts.set_start(X_WQ);
      VisitBudget budget = {1000000};
      const auto found = contacts.sweep(X_WT, kClearance_m, budget);
      REQUIRE(found.complete);
      if (!exact.intersect(X_WT)) continue;
      ++inside;
      INFO("step " << n);
      CHECK((found.overlaps || !found.contacts.empty()));
    }
    CHECK(inside > case_count(20));
  }
}

// After a rotation by 0.05 rad an edge that was held dips by 13 um and leaves the corner on which it lay. No
// other feature is met first. A shaken hand met this case once in a million poses.
TEST_CASE("a path with a large rotation is not free if its end overlaps", "[mesh_contacts]") {
  const Scene scene = scene_of(manipulation_cases()[9]);
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  const Pose from = {{-0.68298246087346626, -0.19239706033389406, 0.68845117377531961, 0.15017759700263147},
                     {0.050170555760934425, 0.032405514058705572, -0.019768710717337615}};
  const Pose to = {{-0.6992801550880553, -0.19230228262919327, 0.67051753479992138, 0.15631165126587176},
                   {0.049002937603635319, 0.030474385760468663, -0.019151829047996116}};
  REQUIRE_FALSE(exact.intersect(from));
  REQUIRE(exact.intersect(to));
  const auto found = sweep_between(scene, from, to);
  CHECK(found.complete);
  CHECK((found.overlaps || !found.contacts.empty()));
}

TEST_CASE("sweeps within the reach of one list need no second traversal", "[mesh_contacts]") {
  const Scene scene = scene_of(manipulation_cases()[7]);
  MeshContacts contacts(scene);
  VisitBudget budget = {1000000};
  contacts.set_start(at(0.11, 0, 0));
  contacts.sweep(at(0.10, 0, 0), kClearance_m, budget);
  const auto walks = [&](const Pose& X_WT) {
    const std::uint32_t before = budget.remaining, visits_before = contacts.sweep_visits();
    contacts.sweep(X_WT, kClearance_m, budget);
    return before - budget.remaining >
           contacts.sweep_visits() - visits_before;  // the candidate pairs are tested again
  };
  CHECK_FALSE(walks(at(0.10, 0.0002, 0)));
  CHECK(walks(at(0.10, 0.01, 0)));
}

}  // namespace
}  // namespace wrenchd::test_mesh_contacts
