// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "core/convex_body.hpp"
#include "tests/support/random_body.hpp"

namespace wrenchd::test_convex_body {

using namespace wrenchd::test;

TEST_CASE("a box has six faces, twelve edges and no diagonal", "[convex_body]") {
  const ConvexBody body = box({1.0, 2.0, 3.0}).hull;
  CHECK(body.faces.size() == 6);
  CHECK(body.edges.size() == 12);
  for (const auto& face : body.faces)
    CHECK(face.offset_m == Approx(0.5 * Vector3d(1.0, 2.0, 3.0).dot(face.n.cwiseAbs())));
  for (std::uint32_t v = 0; v < 8; ++v) CHECK(body.faces_of(v).size() == 3);
}

TEST_CASE("each vertex lists the edges that end at it", "[convex_body]") {
  RandomValues random(5);
  const ConvexBody body = random_body(random, 30).hull;
  std::size_t ends = 0;
  for (std::uint32_t v = 0; v < body.vertices_T_m.size(); ++v)
    for (const std::uint32_t e : body.edges_of(v)) {
      ++ends;
      CHECK((body.edges[e].from == v || body.edges[e].to == v));
    }
  CHECK(ends == 2 * body.edges.size());
}

TEST_CASE("the support is the farthest vertex", "[convex_body]") {
  RandomValues random(1);
  for (int i = 0; i < 300; ++i) {
    const ConvexBody body = random_body(random, random.integer(4, 60)).hull;
    const Vector3d direction = random.unit<3>();
    double highest = -1e9;
    for (const Vector3d& p : body.vertices_T_m) highest = std::max(highest, direction.dot(p));
    CHECK(direction.dot(body.vertices_T_m[body.support(direction)]) == highest);
    const auto anywhere = static_cast<std::uint32_t>(random.integer(0, 3));
    CHECK(direction.dot(body.vertices_T_m[body.support(direction, anywhere)]) == highest);
  }
}

TEST_CASE("support and faces are also correct for a body with many vertices", "[convex_body]") {
  RandomValues random(4);
  const ConvexBody body = convex_hull(make_mesh({"sphere", 20000}).vertices_m);
  REQUIRE(body.vertices_T_m.size() > 8000);
  const auto highest = [&](const Vector3d& direction) {
    double height = -1e9;
    for (const Vector3d& p : body.vertices_T_m) height = std::max(height, direction.dot(p));
    return height;
  };
  for (int i = 0; i < 300; ++i) {
    const Vector3d direction = random.unit<3>();
    CHECK(direction.dot(body.vertices_T_m[body.support(direction)]) == highest(direction));
    const auto anywhere = static_cast<std::uint32_t>(random.integer(0, 8000));
    CHECK(direction.dot(body.vertices_T_m[body.support(direction, anywhere)]) == highest(direction));
    const auto& face = body.faces[static_cast<std::size_t>(random.integer(0, 15000))];
    CHECK(std::abs(face.offset_m - highest(face.n)) < 1e-15);
  }
}

TEST_CASE("faces bound the body", "[convex_body]") {
  RandomValues random(2);
  for (int i = 0; i < 100; ++i) {
    const ConvexBody body = random_body(random, random.integer(4, 40)).hull;
    for (const auto& face : body.faces) {
      CHECK(face.offset_m > 0.0);  // the centre of mass is inside
      for (const Vector3d& p : body.vertices_T_m) CHECK(face.n.dot(p) <= face.offset_m + 1e-12);
    }
    for (std::uint32_t v = 0; v < body.vertices_T_m.size(); ++v)
      for (const std::uint32_t f : body.faces_of(v))
        CHECK(body.faces[f].n.dot(body.vertices_T_m[v]) == Approx(body.faces[f].offset_m).margin(1e-12));
  }
}

TEST_CASE("an edge is touched by planes whose normals lie between those of its faces", "[convex_body]") {
  RandomValues random(3);
  for (int i = 0; i < 50; ++i) {
    const ConvexBody body = random_body(random, random.integer(4, 40)).hull;
    for (const auto& edge : body.edges) {
      const Vector3d m = edge.d.cross(random.unit<3>()).normalized();
      const double height = m.dot(body.vertices_T_m[edge.from]);
      const double highest = m.dot(body.vertices_T_m[body.support(m)]);
      const double slack = std::min(m.dot(edge.side[0]), m.dot(edge.side[1]));
      if (std::abs(slack) < 1e-6) continue;
      CHECK((slack > 0.0) == (highest - height < 1e-12));
    }
  }
}

}  // namespace wrenchd::test_convex_body
