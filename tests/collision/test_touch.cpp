// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "collision/touch.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/overlapping_scene.hpp"

namespace wrenchd::test_touch {

using namespace wrenchd::test;

namespace {

Vector3d vector(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

double off_line_m(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d d = b - a;
  const double along = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
  return (p - a - along * d).norm();
}

/// Returns the distance of a point from a feature, in the frame of the body [m].
double off_mesh_m(const MeshSurface& surface, FeatureKind kind, std::uint32_t first, std::uint32_t second,
                  const Vector3d& p) {
  const auto& v = surface.vertices_m();
  if (kind == FeatureKind::vertex) return (p - v[first]).norm();
  if (kind == FeatureKind::edge) return off_line_m(p, v[first], v[second]);
  REQUIRE(kind == FeatureKind::face);
  return std::abs(surface.planes()[first].normal.dot(p) - surface.planes()[first].offset_m);
}

double off_hull_m(const ConvexBody& hull, FeatureKind kind, std::uint32_t first, std::uint32_t second,
                  const Vector3d& p) {
  const auto& v = hull.vertices_T_m;
  if (kind == FeatureKind::hull_vertex) return (p - v[first]).norm();
  if (kind == FeatureKind::hull_edge) return off_line_m(p, v[first], v[second]);
  REQUIRE(kind == FeatureKind::hull_face);
  return std::abs(hull.faces[first].n.dot(p) - hull.faces[first].offset_m);
}

/// The gradient of T with respect to the tool's position: the sum of the contact loads.
Vector3d carried(const Touches& touches) {
  Vector3d sum = Vector3d::Zero();
  for (const Touch& touch : touches) sum += touch.multiplier_kg_m * vector(touch.normal_W);
  return sum;
}

double shares(const Touches& touches) {
  double sum = 0.0;
  for (const Touch& touch : touches) sum += touch.load_fraction;
  return sum;
}

}  // namespace

TEST_CASE("the contacts of a proxy name features of both meshes that are where it touches", "[touch]") {
  std::array<int, 3> kinds{};
  int slid = 0;
  for (const ManipulationCase& handling : manipulation_cases()) {
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    PenetrationDepth penetration(scene, {});
    REQUIRE(penetration.uses_mesh_features());
    HandTrajectory hand(handling);
    Pose X_WQ{Quaterniond::Identity(), handling.start_m};
    for (int tick = 0; tick < 150; ++tick) {
      const Pose X_WP = hand.next();
      const Penetration depth = penetration.follow(X_WP, X_WQ);
      X_WQ = depth.projection.X_WQ;
      const Touches reported = touches(depth.projection, scene, true);
      if (depth.projection.status != ProjectionStatus::converged || reported.empty()) continue;
      for (const Touch& touch : reported) {
        if (touch.load_fraction == 0.0) continue;
        const MeshObstacle& obstacle = scene.meshes()[touch.obstacle];
        const Vector3d p_W = vector(touch.point_W_m);
        const Vector3d p_T = inverse(X_WQ) * p_W;
        const Vector3d p_O = inverse(obstacle.X_WO) * p_W;
        // Touching features are 1 nm apart. Sometimes a proxy ends where a feature has just slid beyond the
        // end of another.
        const double off_tool_m = off_mesh_m(scene.tool_mesh()->surface, FeatureKind{touch.tool_feature_kind},
                                             touch.tool_first, touch.tool_second, p_T);
        const double off_obstacle_m =
            off_mesh_m(obstacle.mesh->surface, FeatureKind{touch.obstacle_feature_kind}, touch.obstacle_first,
                       touch.obstacle_second, p_O);
        CHECK(std::max(off_tool_m, off_obstacle_m) < 1e-4);
        slid += std::max(off_tool_m, off_obstacle_m) > 1e-6 ? 1 : 0;
        ++kinds[touch.contact_kind];
      }
      const double mass_kg = scene.tool().solid.inertia.mass_kg;
      const Vector3d pulled = 2.0 * mass_kg * (X_WQ.translation_m - X_WP.translation_m);
      CHECK((carried(reported) - pulled).norm() < 1e-6 * pulled.norm() + 1e-12);
      CHECK(shares(reported) == Approx(1.0).epsilon(1e-12));
      for (std::size_t i = 1; i < reported.size(); ++i)
        CHECK(reported[i].load_fraction <= reported[i - 1].load_fraction);
    }
  }
  CHECK(slid < (kinds[0] + kinds[1] + kinds[2]) / 500);
  CHECK(kinds[0] > 100);
  CHECK(kinds[1] > 100);
  CHECK(kinds[2] > 100);
}

TEST_CASE("the contacts of convex bodies name features of their hulls that are where they touch", "[touch]") {
  RandomValues random(3);
  std::array<int, 3> kinds{};
  for (int i = 0; i < 60; ++i) {
    const OverlappingScene c = overlap_body(random, 0.05);
    PenetrationDepth penetration(c.scene, {});
    REQUIRE_FALSE(penetration.uses_mesh_features());
    const Projection q = penetration.query(c.X_WP).projection;
    const Touches reported = touches(q, c.scene, false);
    REQUIRE_FALSE(reported.empty());
    for (const Touch& touch : reported) {
      if (touch.load_fraction == 0.0) continue;
      const Vector3d p_W = vector(touch.point_W_m);
      CHECK(off_hull_m(c.scene.tool().hull, FeatureKind{touch.tool_feature_kind}, touch.tool_first,
                       touch.tool_second, inverse(q.X_WQ) * p_W) < 1e-9);
      // A plane along two edges may touch tool and obstacle at different points.
      if (touch.contact_kind == 2 && FeatureKind{touch.tool_feature_kind} == FeatureKind::hull_vertex)
        continue;
      CHECK(off_hull_m(c.scene.convex()[0].body, FeatureKind{touch.obstacle_feature_kind},
                       touch.obstacle_first, touch.obstacle_second, p_W) < 1e-9);
      ++kinds[touch.contact_kind];
    }
  }
  CHECK(kinds[0] > 5);
  CHECK(kinds[1] > 5);
  CHECK(kinds[2] > 5);
}

TEST_CASE("of too many contacts those with the largest multipliers are reported", "[touch]") {
  const Scene scene(box({1.0, 1.0, 1.0}), {half_space(Vector3d::UnitZ(), 0.0)});
  Projection q;
  for (std::uint32_t i = 0; i < 40; ++i) {
    Contact contact;
    contact.tool_feature = i;
    q.active.add({contact, static_cast<double>((i * 7) % 40)});
  }
  const Touches reported = touches(q, scene, false);
  REQUIRE(reported.size() == kMaxTouches);
  for (std::size_t i = 0; i < reported.size(); ++i) {
    CHECK(reported[i].multiplier_kg_m == static_cast<double>(39 - i));
    CHECK((reported[i].tool_first * 7) % 40 == 39 - i);
    CHECK(reported[i].load_fraction == Approx(static_cast<double>(39 - i) / 780.0));
    CHECK(FeatureKind{reported[i].tool_feature_kind} == FeatureKind::hull_vertex);
    CHECK(FeatureKind{reported[i].obstacle_feature_kind} == FeatureKind::plane);
  }
  CHECK(touches(Projection{}, scene, false).empty());
}

TEST_CASE("features and obstacles have names", "[touch]") {
  CHECK(text({FeatureKind::vertex, 12, 0}) == "vertex 12");
  CHECK(text({FeatureKind::edge, 3, 7}) == "edge 3-7");
  CHECK(text({FeatureKind::hull_face, 5, 0}) == "hull face 5");
  CHECK(text({FeatureKind::plane, 0, 0}) == "plane");
  const Scene scene(box({1.0, 1.0, 1.0}), {{"table", Vector3d::UnitZ(), 0.0}, {"", Vector3d::UnitX(), -1.0}});
  CHECK(obstacle_name(scene, 0) == "table");
  CHECK(obstacle_name(scene, 1) == "obstacle 1");
  CHECK(obstacle_name(scene, 7) == "obstacle 7");
}

}  // namespace wrenchd::test_touch
