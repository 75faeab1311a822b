// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>

#include "collision/scene_contacts.hpp"
#include "tests/support/overlapping_scene.hpp"

namespace wrenchd::test_scene_contacts {

namespace {

using namespace test;

ToolBody cube() {
  return test::box(Vector3d::Constant(2.0));
}

const HalfSpaceSettings kFloor = half_space(Vector3d::UnitZ(), 0.0);

/// Tilted, so that the eight corners have eight different heights.
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
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 4);
  CHECK(contacts.size() == 4);
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 4);
  REQUIRE(contacts.size() == 8);
  for (std::size_t i = 0; i < 8; ++i) CHECK(gap_m(contacts[i], X_WT) == Approx(z[i]));
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 0);
  CHECK(contacts.size() == 8);
}

TEST_CASE("a contact names its vertex, its face and its obstacle") {
  const HalfSpaceSettings wall = half_space({3, 0, 4}, 0.5);
  const Scene scene(cube(), {kFloor, wall});
  const Pose X_WT{kTilt, {0.1, 0.2, 0.3}};
  ContactSet contacts;
  SceneContacts(scene).add_violated(X_WT, 0.0, contacts);
  REQUIRE(contacts.size() > 0);
  bool floor = false, other = false;
  for (const Contact& c : contacts) {
    const HalfSpaceSettings& obstacle = scene.half_spaces()[c.obstacle];
    CHECK(c.p_TCa_m == scene.tool().hull.vertices_T_m[c.tool_feature]);
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
  CHECK(SceneContacts(scene).add_violated(above, 0.0, contacts) == 0);
  const Pose below{Quaterniond::Identity(), {0, 0, 1 - 1e-6}};
  CHECK(SceneContacts(scene).add_violated(below, 2e-6, contacts) == 0);
  CHECK(contacts.size() == 0);
  CHECK(SceneContacts(scene).add_violated(below, 0.5e-6, contacts) == 4);
}

TEST_CASE("every obstacle adds its own contacts") {
  const Scene scene(cube(),
                    {kFloor, half_space(-Vector3d::UnitZ(), -0.5), half_space(Vector3d::UnitX(), -5)});
  ContactSet contacts;
  const Pose X_WT{Quaterniond::Identity(), {0, 0, 0.25}};  // wedged between floor and ceiling
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 8);
  int count[3] = {0, 0, 0};
  for (const Contact& c : contacts) ++count[c.obstacle];
  CHECK(count[0] == 4);
  CHECK(count[1] == 4);
  CHECK(count[2] == 0);
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 0);
}

TEST_CASE("the same vertex may touch two obstacles") {
  const Scene scene(cube(), {kFloor, kFloor});
  ContactSet contacts;
  CHECK(SceneContacts(scene).add_violated({Quaterniond::Identity(), {0, 0, 0.9}}, 0.0, contacts) == 8);
}

TEST_CASE("a full set takes no more, and the count says so") {
  const Scene scene(cube(), {kFloor});
  const Pose X_WT{kTilt, {0, 0, -2}};
  ContactSet contacts;
  Contact other;
  other.obstacle = 1000;
  while (contacts.size() < ContactSet::kCapacity - 1) contacts.add(other);
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 1);
  CHECK(contacts.full());
  CHECK(gap_m(contacts[ContactSet::kCapacity - 1], X_WT) == Approx(heights(scene, X_WT)[0]));
  CHECK(SceneContacts(scene).add_violated(X_WT, 0.0, contacts) == 0);
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
    CHECK(least_gap_m(scene, X_WT) == Approx(least).margin(1e-12));

    ContactSet contacts;
    while (SceneContacts(scene).add_violated(X_WT, 1e-9, contacts) > 0) continue;
    CHECK(contacts.size() == expected);
    for (std::size_t i = 1; i < contacts.size(); ++i)
      CHECK(gap_m(contacts[i - 1], X_WT) <= gap_m(contacts[i], X_WT) + 1e-12);
    for (std::size_t i = 0; i < contacts.size(); ++i)
      for (std::size_t k = 0; k < i; ++k) CHECK_FALSE(same_features(contacts[i], contacts[k]));
  }
}

TEST_CASE("all touching contacts are added at once, none twice") {
  std::vector<Vector3d> corners;
  for (int i = 0; i < 20; ++i)
    for (const double z : {0.0, 1.0})
      corners.emplace_back(std::cos(i * 0.1 * std::numbers::pi), std::sin(i * 0.1 * std::numbers::pi), z);
  const Scene scene(tool_of(corners), {kFloor});
  const Pose on_the_floor{Quaterniond::Identity(), {0.0, 0.0, 0.5}};
  ContactSet contacts;
  SceneContacts touching(scene);
  CHECK(touching.add_violated(on_the_floor, -1e-9, contacts) == 4);
  touching.add_touching(on_the_floor, 1e-9, contacts);
  CHECK(contacts.size() == 20);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    CHECK(std::abs(gap_m(contacts[i], on_the_floor)) < 1e-15);
    for (std::size_t k = 0; k < i; ++k) CHECK_FALSE(same_features(contacts[i], contacts[k]));
  }
  const Pose above{Quaterniond::Identity(), {0.0, 0.0, 0.6}};
  ContactSet none;
  touching.add_touching(above, 1e-9, none);
  CHECK(none.size() == 0);
}

TEST_CASE("an empty scene touches nothing") {
  const Scene scene(cube(), {});
  ContactSet contacts;
  CHECK(SceneContacts(scene).add_violated(Pose(), 0.0, contacts) == 0);
}

TEST_CASE("the best plane of a survey is the separating axis of least depth") {
  RandomValues random(11);
  for (int i = 0; i < 200; ++i) {
    const OverlappingScene met = overlap_body(random, random.uniform(0.01, 0.2));
    SceneContacts contacts(met.scene);
    REQUIRE(contacts.survey_planes(met.X_WP) > 1);
    ContactSet violated;
    REQUIRE(contacts.add_violated(met.X_WP, 0.0, violated) > 0);
    INFO("case " << i);
    CHECK(gap_m(violated[0], met.X_WP) == Approx(separation_m(met.scene, met.X_WP)).epsilon(1e-12));
  }
}

TEST_CASE("a pose that the held planes admit never overlaps, for any planes") {
  RandomValues random(12);
  int admitted = 0;
  for (int i = 0; i < 200; ++i) {
    const OverlappingScene met = overlap_body(random, 0.05);
    SceneContacts contacts(met.scene);
    const std::size_t openings = contacts.survey_planes(met.X_WP);
    for (std::size_t k = 0; k < openings; ++k) {
      contacts.hold_survey_plane(k);
      Pose X_WT = met.X_WP;
      X_WT.translation_m += 0.1 * random.vector<3>();
      ContactSet violated;
      if (contacts.add_violated(X_WT, 0.0, violated) > 0) continue;
      ++admitted;
      REQUIRE(separation_m(met.scene, X_WT) >= -1e-14);
    }
  }
  CHECK(admitted > 100);
}

TEST_CASE("a gap of every kind has the gradient of its contact") {
  RandomValues random(13);
  int found[3] = {};
  for (int i = 0; i < 200; ++i) {
    const OverlappingScene met = overlap_body(random, 0.1);
    SceneContacts contacts(met.scene);
    const std::size_t openings = contacts.survey_planes(met.X_WP);
    for (std::size_t k = 0; k < std::min<std::size_t>(openings, 12); ++k) {
      contacts.hold_survey_plane(k);
      ContactSet violated;
      if (contacts.add_violated(met.X_WP, 0.0, violated) == 0) continue;
      const Contact& contact = violated[0];
      ++found[static_cast<int>(contact.kind)];
      // J = [n ; (c - x) x n] for a touching pair: moves the tool until the pair touches.
      Pose X_WT = met.X_WP;
      X_WT.translation_m -= gap_m(contact, X_WT) * normal_W(contact, X_WT);
      const Vector3d n = normal_W(contact, X_WT);
      const Vector3d lever = contact_point_W(contact, X_WT) - X_WT.translation_m;
      Vector6d J;
      J << n, lever.cross(n);
      const Vector6d step = 1e-6 * random.unit<6>();
      const auto moved = [&](double sign) {
        return Pose{rotation_from(sign * step.tail<3>()) * X_WT.rotation,
                    X_WT.translation_m + sign * step.head<3>()};
      };
      const double difference = gap_m(contact, moved(1.0)) - gap_m(contact, moved(-1.0));
      CHECK(difference == Approx(2.0 * J.dot(step)).margin(1e-12));
    }
  }
  for (const int count : found) CHECK(count > 50);
}

TEST_CASE("an obstacle out of reach is not queried") {
  RandomValues random(14);
  const OverlappingScene met = overlap_body(random, 0.1);
  SceneContacts contacts(met.scene);
  const Pose far{met.X_WP.rotation, {100.0, 0.0, 0.0}};
  ContactSet violated;
  contacts.select_admitting_planes(far, 0.0);
  CHECK(contacts.admits(far, 0.0));
  CHECK(SceneContacts(met.scene).survey_planes(far) == 0);
  CHECK(contacts.add_violated(far, 0.0, violated) == 0);
}

TEST_CASE("a far obstacle does not affect a near one") {
  RandomValues random(15);
  for (int i = 0; i < 20; ++i) {
    const OverlappingScene met = overlap_body(random, 0.1);
    ConvexBody far = met.scene.convex()[0].body;
    for (Vector3d& p : far.vertices_T_m) p += Vector3d(0.0, 0.0, 50.0);
    const Scene both(met.scene.tool(), {half_space(Vector3d::UnitX(), -90.0)},
                     {convex_obstacle("far", far), met.scene.convex()[0]});
    SceneContacts contacts(both);
    CHECK(contacts.survey_planes(met.X_WP) > 0);
    ContactSet violated;
    CHECK(contacts.add_violated(met.X_WP, 0.0, violated) > 0);
    for (const Contact& contact : violated) CHECK(contact.obstacle == 2);
  }
}

}  // namespace
}  // namespace wrenchd::test_scene_contacts
