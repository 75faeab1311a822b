// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <memory>

#include <catch2/catch.hpp>

#include "collision/cgal/exact_decisions.hpp"
#include "collision/contact_detection.hpp"
#include "collision/feasible_pose_search.hpp"
#include "collision/penetration.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/gallery_comparison.hpp"
#include "tests/support/sweep_comparison.hpp"

namespace wrenchd::test_cgal_contacts {

namespace {

using namespace test;

/// The value above x that is nearest to it.
double above(double x) {
  return std::nextafter(x, 1e9);
}

TEST_CASE("a side of a plane is decided to the last bit", "[cgal_contacts]") {
  const Vector3d n = Vector3d(0.3, -0.4, 0.8).normalized();
  const MeshSurface::Plane plane = {n, 0.05};
  RandomValues random(4);
  for (int k = 0; k < case_count(1000); ++k) {
    const Vector3d p = 0.05 * n + 0.1 * n.cross(random.unit<3>());
    // One step of a coordinate may be less than the rounding error of the height in double precision.
    const Vector3d higher(above(p.x()), p.y(), p.z()), lower(p.x(), above(p.y()), p.z());
    const int side = exact::side_of_plane(plane, 0.0, p);
    CHECK(exact::side_of_plane(plane, 0.0, higher) >= side);
    CHECK(exact::side_of_plane(plane, 0.0, lower) <= side);
    CHECK(exact::side_of_plane(plane, 0.0, p + 1e-12 * n) == 1);
    CHECK(exact::side_of_plane(plane, 0.0, p - 1e-12 * n) == -1);
    CHECK(exact::side_of_plane(plane, 1e-9, p + 1.001e-9 * n) == 1);
    CHECK(exact::side_of_plane(plane, 1e-9, p + 0.999e-9 * n) == -1);
  }
  CHECK(exact::side_of_plane({Vector3d::UnitZ(), 0.1}, 0.0, {1e3, -1e3, 0.1}) == 0);
  CHECK(exact::side_of_plane({Vector3d::UnitZ(), 0.1}, 0.0, {1e3, -1e3, above(0.1)}) == 1);
}

TEST_CASE("the gap of two edges is compared exactly", "[cgal_contacts]") {
  const exact::EdgePair crossed = {{-1, 0, 0.25}, {2, 0, 0}, {0, -1, 0}, {0, 2, 0}, 1.0};
  CHECK(exact::compare_gap(crossed, 0.0) == 1);
  CHECK(exact::compare_gap(crossed, 0.25) == 0);
  CHECK(exact::compare_gap(crossed, above(0.25)) == -1);
  CHECK(exact::compare_gap(crossed, -0.25) == 1);
  exact::EdgePair below = crossed;
  below.sign = -1.0;
  CHECK(exact::compare_gap(below, 0.0) == -1);
  CHECK(exact::compare_gap(below, -0.25) == 0);
  CHECK(exact::compare_gap(below, -above(0.25)) == 1);
  CHECK(exact::edges_opposite(crossed, 0.0));
  exact::EdgePair beside = crossed;
  beside.a0.x() = 0.125;  // the first edge begins 0.125 beyond the second
  CHECK_FALSE(exact::edges_opposite(beside, 0.0));
  CHECK_FALSE(exact::edges_opposite(beside, 0.1249));
  CHECK(exact::edges_opposite(beside, 0.125));
  exact::EdgePair parallel = crossed;
  parallel.db = {1, 0, 0};
  CHECK_FALSE(exact::edges_opposite(parallel, 1.0));
}

TEST_CASE("a point projects into a triangle, on its border, or beyond", "[cgal_contacts]") {
  const Triangle triangle = {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)};
  const Vector3d up = Vector3d::UnitZ();
  CHECK(exact::projects_inside({0.25, 0.25, 3.0}, triangle, up, 0.0));
  CHECK(exact::projects_inside({0.5, 0.0, 3.0}, triangle, up, 0.0));
  CHECK_FALSE(exact::projects_inside({0.5, -std::nextafter(0.0, 1.0), 3.0}, triangle, up, 0.0));
  CHECK(exact::projects_inside({0.5, -0.125, 3.0}, triangle, up, 0.125));
  CHECK_FALSE(exact::projects_inside({0.5, -above(0.125), 3.0}, triangle, up, 0.125));
}

// The main test: two implementations that share the definition of a contact and no search.
TEST_CASE("wrenchd's kernels and CGAL meet the same contacts", "[cgal_contacts]") {
  constexpr int kRandomPaths = 3;
  const BodyKind kind = GENERATE(BodyKind::solid, BodyKind::surface);
  SweepCounts all;
  for (ManipulationCase handling : manipulation_cases()) {
    handling.obstacle_kind = kind;
    INFO(handling.name << (kind == BodyKind::surface ? ", as a surface" : ""));
    // A tool that is shaken begins beside the obstacle and reaches it later.
    const int ticks = handling.motion == Handling::shake ? 150 : 40;
    const SweepCounts counts = compare_sweeps(handling, case_count(ticks), kRandomPaths, 7);
    INFO(counts.first_difference);
    CHECK(counts.different == 0);
    all.add(counts);
  }
  CHECK(all.largest_difference == 0.0);
  CHECK(all.sweeps > case_count(6000));
  CHECK(all.contacts > case_count(5000));
  CHECK(all.touching > case_count(50));
}

TEST_CASE("both overlap tests agree, and agree with exact arithmetic", "[cgal_contacts]") {
  RandomValues random(3);
  int overlapping = 0, apart = 0;
  for (const ManipulationCase& handling : manipulation_cases()) {
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    const ExactIntersection intersection(scene.tool_mesh()->surface.mesh(),
                                         scene.meshes()[0].mesh->surface.mesh());
    const auto native = make_overlap_test(scene, ContactBackend::native);
    const auto cgal = make_overlap_test(scene, ContactBackend::cgal);
    for (int k = 0; k < case_count(40); ++k) {
      const Pose X_OT = {random.rotation(),
                         random.uniform(0.0, 1.5) * handling.start_m.norm() * random.unit<3>()};
      const bool overlaps = cgal->overlaps(scene.meshes()[0], X_OT);
      CHECK(native->overlaps(scene.meshes()[0], X_OT) == overlaps);
      if (intersection.intersect(X_OT)) CHECK(overlaps);
      ++(overlaps ? overlapping : apart);
    }
  }
  CHECK(overlapping > case_count(200));
  CHECK(apart > case_count(200));
}

TEST_CASE("a body in another one, and a tool around an obstacle, overlap for CGAL too", "[cgal_contacts]") {
  const auto overlaps = [](const GeneratedMesh& tool, const GeneratedMesh& obstacle) {
    std::vector<MeshObstacle> obstacles;
    obstacles.push_back({"obstacle", MeshBvh(make_mesh(obstacle)), Pose{}});
    const Scene scene(mesh_tool(make_mesh(tool)), {}, {}, std::move(obstacles));
    return make_overlap_test(scene, ContactBackend::cgal)->overlaps(scene.meshes()[0], Pose{});
  };
  CHECK(overlaps({"bolt", 500}, {"cube", 500}));
  CHECK(overlaps({"cube", 500}, {"bolt", 500}));
  CHECK_FALSE(overlaps({"peg", 400}, {"hole", 800}));
}

TEST_CASE("a proxy has the same poses with either contact detection", "[cgal_contacts]") {
  for (const std::size_t i : {1, 7, 15, 19}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    Proxy::WorkLimit unbalanced;  // the kernels may defer work, CGAL never does
    unbalanced.balanced = false;
    Proxy native(scene, unbalanced), cgal(scene, ContactBackend::cgal);
    HandTrajectory hand(handling);
    Pose X_native = {Quaterniond::Identity(), handling.start_m}, X_cgal = X_native;
    for (int n = 0; n < case_count(200); ++n) {
      const Pose X_WP = hand.next();
      const Projection a = native.follow(X_WP, X_native), b = cgal.follow(X_WP, X_cgal);
      X_native = a.X_WQ;
      X_cgal = b.X_WQ;
      if (a.status == ProjectionStatus::budget_spent || b.status == ProjectionStatus::budget_spent) continue;
      INFO("tick " << n);
      REQUIRE((X_native.translation_m - X_cgal.translation_m).norm() < 1e-9);
      REQUIRE((X_native.rotation.coeffs() - X_cgal.rotation.coeffs()).norm() < 1e-9);
    }
  }
}

TEST_CASE("the search for an admissible pose works with CGAL", "[cgal_contacts]") {
  const Scene scene = scene_of(manipulation_cases()[7]);
  FeasiblePoseSearch native(scene), cgal(scene, ContactBackend::cgal);
  const Pose X_WP = {Quaterniond::Identity(), {0.06, 0.01, 0.0}};
  const Projection a = native.nearest(X_WP), b = cgal.nearest(X_WP);
  CHECK(cgal.admissible(b.X_WQ));
  CHECK(b.energy == Approx(a.energy).epsilon(1e-6));
}

TEST_CASE("only method exact detects contacts with CGAL", "[cgal_contacts]") {
  PenetrationDepth::Options options;
  options.method = Method::planar;
  options.contacts = ContactBackend::cgal;
  const Scene scene = scene_of(manipulation_cases()[0]);
  CHECK_THROWS_WITH(PenetrationDepth(scene, options),
                    Catch::Contains("only method exact") && Catch::Contains("[rendering] contacts"));
}

// prove_contacts --gallery runs all scenes to the end.
TEST_CASE("the gallery has the same proxy with contacts = \"cgal\"", "[cgal_contacts][gallery]") {
  const bool closed_loop = GENERATE(false, true);
  const std::string scene =
      GENERATE(as<std::string>{}, "paper_cube", "staircase", "moving_obstacle", "thin_plate", "peg_in_hole");
  INFO(scene << (closed_loop ? ", closed loop" : ", open loop"));
  const GalleryComparison run = compare_gallery_scene(scene, closed_loop, case_count(3000) / 1000.0);
  CHECK(run.compared + run.native_spent > case_count(1600));
  CHECK(run.different == 0);
  CHECK(run.cgal_spent == 0);
  // The hands part only where the kernels deferred work.
  if (run.hands_parted >= 0) CHECK((run.native_spent > 0 && run.hands_parted > run.first_native_spent));
}

}  // namespace
}  // namespace wrenchd::test_cgal_contacts
