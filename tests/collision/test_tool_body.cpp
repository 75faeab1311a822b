// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <random>
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/tool_body.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_tool_body {

namespace {

using namespace test;

/// An L of three unit squares in x and y, `height` high from z = 0.
PolygonSoup ell(double height) {
  PolygonSoup soup{{}, {{5, 4, 3, 2, 1, 0}, {6, 7, 8, 9, 10, 11}}};
  for (const double z : {0.0, height})
    for (const auto& [x, y] : {std::pair{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}})
      soup.vertices.emplace_back(x, y, z);
  for (std::size_t i = 0; i < 6; ++i) soup.faces.push_back({i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6});
  return soup;
}

/// Returns the message with which the tool is rejected; empty if it loads.
std::string rejection_text(const ToolSettings& settings) {
  try {
    load_tool(settings);
  } catch (const MeshError& error) {
    return error.what();
  }
  return {};
}

/// The ring of each vertex is a cycle: each neighbour, the next one and the vertex form a face of the hull,
/// with all other vertices behind it.
void check_rings(const ConvexBody& body) {
  const auto& p = body.vertices_T_m;
  REQUIRE(body.ring_begin.size() == p.size() + 1);
  std::size_t edges = 0;
  for (std::size_t v = 0; v < p.size(); ++v) {
    const auto ring = body.ring_of(v);
    REQUIRE(ring.size() >= 3);
    CHECK(std::set<std::uint32_t>(ring.begin(), ring.end()).size() == ring.size());
    edges += ring.size();
    int orientation = 0;  // the same orientation at every step
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const std::uint32_t a = ring[i], b = ring[(i + 1) % ring.size()];
      const auto back = body.ring_of(a);
      CHECK(std::find(back.begin(), back.end(), v) != back.end());
      const Vector3d n = (p[a] - p[v]).cross(p[b] - p[v]).normalized();
      double least = 0.0, most = 0.0;
      for (const Vector3d& q : p) {
        least = std::min(least, n.dot(q - p[v]));
        most = std::max(most, n.dot(q - p[v]));
      }
      CHECK(std::min(-least, most) < 1e-9 * (most - least));
      const int side = most > -least ? 1 : -1;
      CHECK((orientation == 0 || orientation == side));
      orientation = side;
    }
  }
  CHECK(edges / 2 == 3 * p.size() - 6);  // Euler's formula; all faces are triangles
}

TEST_CASE("a tool is scaled to metres, and its mass is that of the whole solid") {
  const TemporaryDirectory dir;
  const auto file = dir.write("box.off", as_off(box({0, 0, 0}, {20, 30, 50})));
  const ToolBody tool = load_tool({file, 0.001, 0.3});
  CHECK(tool.solid.volume_m3 == Approx(30e-6));
  CHECK(tool.solid.inertia.mass_kg == 0.3);
  const Matrix3d H = 0.3 / 12 * 1e-4 * Vector3d(9 + 25, 4 + 25, 4 + 9).asDiagonal().toDenseMatrix();
  CHECK((tool.solid.inertia.H_kg_m2 - H).norm() < 1e-15);
  CHECK(tool.hull.vertices_T_m.size() == 8);
  check_rings(tool.hull);
}

TEST_CASE("the body frame is at the centre of mass, wherever the mesh's own frame is") {
  const TemporaryDirectory dir;
  const Vector3d shift(100, -200, 50);
  const auto file = dir.write("box.obj", as_obj(box(shift - Vector3d(1, 2, 3), shift + Vector3d(1, 2, 3))));
  const ToolBody tool = load_tool({file, 0.5, 2.0});
  CHECK((tool.solid.p_MT_m - 0.5 * shift).norm() < 1e-12);
  CHECK((tool.X_MT().translation_m - 0.5 * shift).norm() < 1e-12);
  CHECK(tool.X_MT().rotation.isApprox(Quaterniond::Identity()));
  for (const Vector3d& a : tool.hull.vertices_T_m)
    CHECK((a.cwiseAbs() - Vector3d(0.5, 1, 1.5)).norm() < 1e-12);
}

TEST_CASE("the mass of a tool scales its inertia and nothing else") {
  const TemporaryDirectory dir;
  const auto file = dir.write("ell.off", as_off(ell(2)));
  const ToolBody one = load_tool({file, 1.0, 1.0}), seven = load_tool({file, 1.0, 7.0});
  CHECK((seven.solid.inertia.H_kg_m2 - 7 * one.solid.inertia.H_kg_m2).norm() < 1e-12);
  CHECK(seven.solid.volume_m3 == one.solid.volume_m3);
  CHECK(seven.solid.p_MT_m == one.solid.p_MT_m);
  CHECK(seven.hull.vertices_T_m == one.hull.vertices_T_m);
}

TEST_CASE("a body that is not convex keeps its own mass and touches with its hull") {
  const TemporaryDirectory dir;
  const ToolBody tool = load_tool({dir.write("ell.off", as_off(ell(2))), 1.0, 1.0});
  CHECK(tool.solid.volume_m3 == Approx(6));
  // Three unit squares around (0.5, 0.5), (1.5, 0.5), (0.5, 1.5).
  CHECK((tool.solid.p_MT_m - Vector3d(5.0 / 6, 5.0 / 6, 1)).norm() < 1e-12);
  CHECK(tool.hull.vertices_T_m.size() == 10);  // all but the two at the inner corner
  const Vector3d inner = Vector3d(1, 1, 0) - tool.solid.p_MT_m;
  for (const Vector3d& a : tool.hull.vertices_T_m) CHECK((a - inner).head<2>().norm() > 0.5);
  check_rings(tool.hull);
}

TEST_CASE("a cavity weighs nothing and touches nothing; an unused vertex is no part of the body") {
  const TemporaryDirectory dir;
  PolygonSoup soup =
      concatenated(box({0, 0, 0}, {2, 3, 5}), inside_out(box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5})));
  soup.vertices.emplace_back(100, 100, 100);
  const ToolBody tool = load_tool({dir.write("hollow.off", as_off(soup)), 1.0, 1.0});
  CHECK(tool.solid.volume_m3 == Approx(29));
  CHECK((tool.solid.p_MT_m - (30 * Vector3d(1, 1.5, 2.5) - Vector3d(1, 1, 1)) / 29).norm() < 1e-12);
  CHECK(tool.hull.vertices_T_m.size() == 8);
}

TEST_CASE("a flat face has its corners only, however finely it is divided") {
  PolygonSoup soup;
  const auto corner = [&](double u, double v, int axis, double side) {
    Vector3d p;
    p[axis] = side;
    p[(axis + 1) % 3] = u;
    p[(axis + 2) % 3] = v;
    p = Vector3d(2 * p.x() + p.z(), p.y() + p.z(),
                 p.x() + p.z());  // integers: the faces are exactly flat, but inclined
    for (std::size_t i = 0; i < soup.vertices.size(); ++i)
      if (soup.vertices[i] == p) return i;
    soup.vertices.push_back(p);
    return soup.vertices.size() - 1;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < 7; ++i) {
      for (int k = 0; k < 7; ++k) {
        soup.faces.push_back({corner(i, k, axis, 7), corner(i + 1, k, axis, 7), corner(i + 1, k + 1, axis, 7),
                              corner(i, k + 1, axis, 7)});
        soup.faces.push_back({corner(i, k, axis, 0), corner(i, k + 1, axis, 0), corner(i + 1, k + 1, axis, 0),
                              corner(i + 1, k, axis, 0)});
      }
    }
  }
  const TemporaryDirectory dir;
  const ToolBody tool = load_tool({dir.write("fine.off", as_off(soup)), 0.001, 1.0});
  CHECK(tool.solid.volume_m3 == Approx(343e-9));
  CHECK(tool.hull.vertices_T_m.size() == 8);
}

TEST_CASE("the ring of a hull's vertex runs once around it") {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const int count : {4, 8, 50, 500}) {
    std::vector<Vector3d> points;
    for (int i = 0; i < count; ++i)
      points.push_back(Vector3d(normal(random), normal(random), normal(random)).normalized());
    const Vector3d middle = 0.25 * (points[0] + points[1] + points[2] + points[3]);
    points.push_back(middle);
    points.push_back(0.5 * (points[0] + middle));
    const ConvexBody body = convex_hull(points);
    CHECK(body.vertices_T_m.size() >= 4);
    CHECK(body.vertices_T_m.size() <= static_cast<std::size_t>(count));
    check_rings(body);
  }
}

TEST_CASE("an unusable tool is rejected with its file and the remedy") {
  const TemporaryDirectory dir;
  const auto good = dir.write("box.off", as_off(box({0, 0, 0}, {2, 3, 5})));
  for (const char* text : {"1e-200", "1e-110", "1e+110", "1e+200", "0", "-1"}) {
    const double scale = std::stod(text);
    const std::string message = rejection_text({good, scale, 1.0});
    INFO(scale << ": " << message);
    CHECK(message.find(good.string() + ": has no usable volume at scale " + text) == 0);
    CHECK(message.find("give 'scale' in metres per mesh unit") != std::string::npos);
  }
  CHECK(rejection_text({dir.path() / "none.off", 1.0, 1.0}).find("no such file") != std::string::npos);

  PolygonSoup open = box({0, 0, 0}, {2, 3, 5});
  open.faces.pop_back();
  open.faces.push_back({0, 1});
  const auto bad = dir.write("open.off", as_off(open));
  const std::string message = rejection_text({bad, 1.0, 1.0});
  INFO(message);
  CHECK(message.find(bad.string() + ": is not a closed, consistently oriented solid:\n  the edge from (") ==
        0);
  CHECK(message.find(
            "\n  (after a repair: removed 1 face with fewer than three different corners: face 5 near ") !=
        std::string::npos);
  CHECK(message.find("kind = \"surface\"") != std::string::npos);
}

}  // namespace
}  // namespace wrenchd::test_tool_body
