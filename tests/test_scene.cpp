// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "collision/convex_hull.hpp"
#include "collision/mesh_file.hpp"
#include "collision/scene.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd {
namespace {

using namespace test;

/// A tool of the given hull; a scene asks for no more of it.
ToolBody tool_of(const std::vector<Vector3d>& points) {
  ToolBody tool;
  tool.hull = convex_hull(points);
  return tool;
}

ToolBody cube() {
  return tool_of(box({-1, -1, -1}, {1, 1, 1}).vertices);
}

HalfSpaceSettings half_space(const Vector3d& normal, double offset) {
  return {"", normal.normalized(), offset};
}

const HalfSpaceSettings kFloor = half_space(Vector3d::UnitZ(), 0.0);

/// Tilted, so that the eight corners stand at eight heights.
const Quaterniond kTilt(Eigen::AngleAxisd(0.3, Vector3d(1, 2, 0).normalized()));

std::vector<double> heights(const Scene& scene, const Pose& X_WT) {
  std::vector<double> z;
  for (const Vector3d& a : scene.tool().hull.vertices_T_m) z.push_back((X_WT * a).z());
  std::sort(z.begin(), z.end());
  return z;
}

TEST_CASE("the deepest contacts come first, at most four of an obstacle, and none twice") {
  const Scene scene(cube(), {kFloor});
  const Pose X_WT{kTilt, {0, 0, -2}};  // all eight corners are below
  const std::vector<double> z = heights(scene, X_WT);
  ContactSet contacts;
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 4);
  CHECK(contacts.size() == 4);
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 4);
  REQUIRE(contacts.size() == 8);
  for (std::size_t i = 0; i < 8; ++i) CHECK(gap_m(contacts[i], X_WT) == Approx(z[i]));
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 0);
  CHECK(contacts.size() == 8);
}

TEST_CASE("a contact tells its vertex, its face and its obstacle") {
  const HalfSpaceSettings wall = half_space({3, 0, 4}, 0.5);
  const Scene scene(cube(), {kFloor, wall});
  const Pose X_WT{kTilt, {0.1, 0.2, 0.3}};
  ContactSet contacts;
  scene.add_violated(X_WT, 0.0, contacts);
  REQUIRE(contacts.size() > 0);
  bool floor = false, other = false;
  for (const Contact& c : contacts) {
    const HalfSpaceSettings& obstacle = scene.half_spaces()[c.obstacle];
    CHECK(c.p_TA_m == scene.tool().hull.vertices_T_m[c.vertex]);
    CHECK(c.n_W == obstacle.normal_W);
    CHECK(c.offset_m == obstacle.offset_m);
    CHECK(gap_m(c, X_WT) < 0);
    (c.obstacle == 0 ? floor : other) = true;
  }
  CHECK(floor);
  CHECK(other);
}

TEST_CASE("a gap within the tolerance is no violation") {
  const Scene scene(cube(), {kFloor});
  ContactSet contacts;
  const Pose above{Quaterniond::Identity(), {0, 0, 1}};  // four corners touch
  CHECK(scene.add_violated(above, 0.0, contacts) == 0);
  const Pose below{Quaterniond::Identity(), {0, 0, 1 - 1e-6}};
  CHECK(scene.add_violated(below, 2e-6, contacts) == 0);
  CHECK(contacts.size() == 0);
  CHECK(scene.add_violated(below, 0.5e-6, contacts) == 4);
}

TEST_CASE("every obstacle adds its own contacts") {
  const Scene scene(cube(),
                    {kFloor, half_space(-Vector3d::UnitZ(), -0.5), half_space(Vector3d::UnitX(), -5)});
  ContactSet contacts;
  const Pose X_WT{Quaterniond::Identity(), {0, 0, 0.25}};  // wedged between floor and ceiling
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 8);
  int count[3] = {0, 0, 0};
  for (const Contact& c : contacts) ++count[c.obstacle];
  CHECK(count[0] == 4);
  CHECK(count[1] == 4);
  CHECK(count[2] == 0);
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 0);
}

TEST_CASE("the same vertex may touch two obstacles") {
  const Scene scene(cube(), {kFloor, kFloor});
  ContactSet contacts;
  CHECK(scene.add_violated({Quaterniond::Identity(), {0, 0, 0.9}}, 0.0, contacts) == 8);
}

TEST_CASE("a full set takes no more, and the count says so") {
  const Scene scene(cube(), {kFloor});
  const Pose X_WT{kTilt, {0, 0, -2}};
  ContactSet contacts;
  Contact other;
  other.obstacle = 1000;
  while (contacts.size() < ContactSet::kCapacity - 1) contacts.add(other);
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 1);
  CHECK(contacts.full());
  CHECK(gap_m(contacts[ContactSet::kCapacity - 1], X_WT) == Approx(heights(scene, X_WT)[0]));
  CHECK(scene.add_violated(X_WT, 0.0, contacts) == 0);
  CHECK(contacts.size() == ContactSet::kCapacity);
}

TEST_CASE("rounds of add_violated find every violated vertex, in order of depth") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
  for (int round = 0; round < 50; ++round) {
    std::vector<Vector3d> points(30);
    for (Vector3d& p : points) p = vector();
    const HalfSpaceSettings obstacle = half_space(vector(), 0.3 * normal(random));
    const Scene scene(tool_of(points), {obstacle});
    const Pose X_WT{Quaterniond(Eigen::AngleAxisd(2 * normal(random), vector().normalized())),
                    0.5 * vector()};

    std::size_t expected = 0;
    double least = std::numeric_limits<double>::infinity();
    for (const Vector3d& a : scene.tool().hull.vertices_T_m) {
      const double gap = obstacle.normal_W.dot(X_WT * a) - obstacle.offset_m;
      least = std::min(least, gap);
      expected += gap < -1e-9 ? 1 : 0;
    }
    CHECK(scene.least_gap_m(X_WT) == Approx(least).margin(1e-12));

    ContactSet contacts;
    while (scene.add_violated(X_WT, 1e-9, contacts) > 0) continue;
    CHECK(contacts.size() == expected);
    for (std::size_t i = 1; i < contacts.size(); ++i)
      CHECK(gap_m(contacts[i - 1], X_WT) <= gap_m(contacts[i], X_WT) + 1e-12);
    for (std::size_t i = 0; i < contacts.size(); ++i)
      for (std::size_t k = 0; k < i; ++k) CHECK_FALSE(same_features(contacts[i], contacts[k]));
  }
}

TEST_CASE("the least gap is that of the nearest obstacle") {
  const Scene scene(cube(), {kFloor, half_space(Vector3d::UnitX(), -5)});
  CHECK(scene.least_gap_m({Quaterniond::Identity(), {0, 0, 3}}) == Approx(2));
  CHECK(scene.least_gap_m({Quaterniond::Identity(), {-3.5, 0, 3}}) == Approx(0.5));
  CHECK(scene.least_gap_m({Quaterniond::Identity(), {-3.5, 0, 0.25}}) == Approx(-0.75));
}

TEST_CASE("an empty scene touches nothing") {
  const Scene scene(cube(), {});
  ContactSet contacts;
  CHECK(scene.add_violated(Pose(), 0.0, contacts) == 0);
  CHECK(scene.least_gap_m(Pose()) == std::numeric_limits<double>::infinity());
}

TEST_CASE("a scene is built from its settings, and refuses a bad mesh") {
  const TemporaryDirectory dir;
  SceneSettings settings;
  settings.tool.mesh = dir.write("box.off", as_off(box({0, 0, 0}, {2, 2, 2})));
  settings.tool.scale = 0.5;
  settings.half_spaces = {kFloor};
  const Scene scene(settings);
  // X_WT is the pose of the centre of mass: half the side is 0.5 m.
  CHECK(scene.least_gap_m({Quaterniond::Identity(), {0, 0, 2}}) == Approx(1.5));
  settings.tool.mesh = dir.path() / "none.off";
  CHECK_THROWS_AS(Scene(settings), MeshError);
}

}  // namespace
}  // namespace wrenchd
