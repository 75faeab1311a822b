// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "collision/overlap_test.hpp"
#include "collision/proxy.hpp"
#include "collision/scene.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_tools_of_any_kind {

namespace {

namespace fs = std::filesystem;
using namespace test;

/// A box without its lid.
PolygonSoup tray() {
  PolygonSoup soup = box({-0.03, -0.02, -0.01}, {0.03, 0.02, 0.01});
  soup.faces.pop_back();
  return soup;
}

ToolSettings surface_tool(const fs::path& mesh, InertiaSource source) {
  ToolSettings settings;
  settings.mesh = mesh;
  settings.mass_kg = 0.3;
  settings.kind = BodyKind::surface;
  settings.inertia_source = source;
  settings.shell_thickness_m = 0.002;
  return settings;
}

TEST_CASE("a surface as the tool has the inertia of its convex hull, of a shell, or the given one",
          "[tool]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("tray.off", as_off(tray()));
  MeshLoader loader;
  const ToolBody hull = load_tool(surface_tool(file, InertiaSource::hull), loader);
  CHECK(hull.kind == BodyKind::surface);
  CHECK(hull.solid.volume_m3 == Approx(0.06 * 0.04 * 0.02));
  CHECK(hull.solid.p_MT_m.norm() < 1e-15);
  const Matrix3d H = 0.3 / 12 * 1e-4 * Vector3d(16 + 4, 36 + 4, 36 + 16).asDiagonal().toDenseMatrix();
  CHECK((hull.solid.inertia.H_kg_m2 - H).norm() < 1e-15);
  CHECK(hull.hull.vertices_T_m.size() == 8);
  REQUIRE(loader.changes().size() == 2);
  CHECK(loader.changes()[1] ==
        file.string() + ": as the tool, its inertia is that of its convex hull, filled uniformly");

  const ToolBody shell = load_tool(surface_tool(file, InertiaSource::shell), loader);
  const double area = 0.06 * 0.04 + 2 * 0.02 * (0.06 + 0.04);
  CHECK(shell.solid.volume_m3 == Approx(0.002 * area));
  // The floor draws the centre of mass down: the walls balance each other.
  CHECK((shell.solid.p_MT_m - Vector3d(0, 0, -0.01 * 0.06 * 0.04 / area)).norm() < 1e-15);

  ToolSettings given = surface_tool(file, InertiaSource::given);
  given.centre_of_mass_m = {0.001, 0.002, 0.003};
  given.inertia_kg_m2 = Vector3d(1e-4, 2e-4, 2.5e-4).asDiagonal();
  const ToolBody own = load_tool(given, loader);
  CHECK(own.solid.p_MT_m == given.centre_of_mass_m);
  CHECK(own.solid.inertia.H_kg_m2 == given.inertia_kg_m2);
  CHECK(own.solid.inertia.mass_kg == 0.3);
  CHECK((own.mesh.vertices_m[0] - (tray().vertices[0] - given.centre_of_mass_m)).norm() < 1e-15);
}

TEST_CASE("a thin spherical shell has two thirds of m r^2, and a plate that of a plate", "[tool]") {
  const SolidProperties sphere = shell_properties(make_mesh({"sphere", 20000}), 2.0, 1e-6);
  const double measured = sphere.inertia.H_kg_m2.trace() / 3.0;
  const double radius = std::sqrt(measured / (2.0 / 3.0 * 2.0));
  CHECK(radius == Approx(make_mesh({"sphere", 20000}).vertices_m[0].norm()).epsilon(1e-3));
  const TriangleMesh plate = {{{0, 0, 0}, {0.2, 0, 0}, {0.2, 0.1, 0}, {0, 0.1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  const SolidProperties flat = shell_properties(plate, 1.2, 0.01);
  CHECK((flat.p_MT_m - Vector3d(0.1, 0.05, 0)).norm() < 1e-15);
  const Matrix3d H =
      1.2 / 12 * Vector3d(0.01 + 0.0001, 0.04 + 0.0001, 0.04 + 0.01).asDiagonal().toDenseMatrix();
  CHECK((flat.inertia.H_kg_m2 - H).norm() < 1e-15);
}

TEST_CASE("a flat sheet can be a tool", "[tool]") {
  const TemporaryDirectory dir;
  const PolygonSoup sheet{{{0, 0, 0}, {0.2, 0, 0}, {0.2, 0.1, 0}, {0, 0.1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  const fs::path file = dir.write("sheet.off", as_off(sheet));
  for (const InertiaSource source : {InertiaSource::hull, InertiaSource::shell}) {
    const ToolBody tool = load_tool(surface_tool(file, source));
    CHECK(tool.solid.inertia.H_kg_m2.determinant() > 0.0);
    CHECK((tool.solid.p_MT_m - Vector3d(0.1, 0.05, 0)).norm() < 1e-6);
    for (const Vector3d& p : tool.hull.vertices_T_m) CHECK(std::abs(p.z()) < 1e-6);
  }
}

SceneSettings tray_over_post(const TemporaryDirectory& dir, BodyKind post) {
  SceneSettings settings;
  settings.tool = surface_tool(dir.write("tray.off", as_off(tray())), InertiaSource::hull);
  MeshObstacleSettings& obstacle = settings.meshes.emplace_back();
  obstacle.name = "post";
  obstacle.mesh = dir.write("post.off", as_off(box({-0.01, -0.01, -0.1}, {0.01, 0.01, 0})));
  obstacle.kind = post;
  return settings;
}

TEST_CASE("a tray as the tool meets a post with its floor from both sides, and nothing passes through",
          "[tool]") {
  const TemporaryDirectory dir;
  for (const BodyKind kind : {BodyKind::solid, BodyKind::surface})
    for (const ContactBackend backend : {ContactBackend::native, ContactBackend::cgal}) {
      const Scene scene(tray_over_post(dir, kind));
      CHECK(scene.tool_mesh()->surface.kind() == BodyKind::surface);
      CHECK(scene.convex().empty());
      Proxy proxy(scene, {}, backend);
      // From above, the floor of the tray rests on the post: the origin is 10 mm above the floor.
      Pose X = {Quaterniond::Identity(), {0.003, 0.004, 0.05}};
      for (int i = 0; i < 20; ++i) X = proxy.follow({Quaterniond::Identity(), {0.003, 0.004, -0.03}}, X).X_WQ;
      CHECK(X.translation_m.z() == Approx(0.01).margin(1e-6));
      // Upside down, the open side admits the post, up to the floor.
      const Quaterniond over(Eigen::AngleAxisd(3.14159265358979, Vector3d::UnitX()));
      X = {over, {0.001, 0.001, 0.05}};
      for (int i = 0; i < 20; ++i) X = proxy.follow({over, {0.001, 0.001, -0.05}}, X).X_WQ;
      CHECK(X.translation_m.z() == Approx(-0.01).margin(1e-5));
    }
}

TEST_CASE("random motions of a surface as the tool leave no overlap", "[tool]") {
  const TemporaryDirectory dir;
  for (const BodyKind kind : {BodyKind::solid, BodyKind::surface}) {
    const Scene scene(tray_over_post(dir, kind));
    NativeOverlapTest test(scene);
    Proxy proxy(scene);
    RandomValues random(7);
    Pose X = {Quaterniond::Identity(), {0, 0, 0.06}}, P = X;
    int touching = 0;
    for (int tick = 0; tick < 3000; ++tick) {
      P.translation_m = 0.9 * P.translation_m + 0.01 * random.unit<3>();
      P.rotation = (P.rotation * rotation_from(0.1 * random.unit<3>())).normalized();
      const Projection q = proxy.follow(P, X);
      X = q.X_WQ;
      touching += q.active.empty() ? 0 : 1;
      if (tick % 10 == 0) CHECK_FALSE(test.overlaps(scene.meshes()[0], inverse(scene.meshes()[0].X_WO) * X));
    }
    CHECK(touching > 300);
  }
}

TEST_CASE("a surface contains nothing, and a solid contains every part of a surface", "[tool]") {
  const TemporaryDirectory dir;
  SceneSettings settings = tray_over_post(dir, BodyKind::solid);
  settings.tool.mesh =
      dir.write("two.off", as_off(concatenated(tray(), box({1, 1, 1}, {1.001, 1.001, 1.001}))));
  const Scene scene(settings);
  FeasiblePoseSearch search(scene);
  const Vector3d T = scene.tool().solid.p_MT_m;
  // The small box, not the tray, lies in the post.
  CHECK_FALSE(search.admissible({Quaterniond::Identity(), T - Vector3d(1, 1, 1) - Vector3d(0, 0, 0.05)}));
  CHECK(search.admissible({Quaterniond::Identity(), T + Vector3d(0, 0, 0.05)}));
}

TEST_CASE("a set of solids is one body: the union, with its volume counted once", "[tool]") {
  const TemporaryDirectory dir;
  const fs::path a = dir.write("a.off", as_off(box({0, 0, 0}, {0.2, 0.1, 0.1}))),
                 b = dir.write("b.stl", as_ascii_stl(triangulated(box({0.1, 0, 0}, {0.3, 0.1, 0.1})))),
                 both =
                     dir.write("both.off", as_off(concatenated(box({0, 0, 0}, {0.2, 0.1, 0.1}),
                                                               box({0.1, 0.02, 0.02}, {0.3, 0.08, 0.08}))));
  MeshLoader loader;
  const auto two = loader.load_parts({a, b}, BodyKind::solid);
  CHECK(loader.load_parts({a, b}, BodyKind::solid) == two);
  CHECK_FALSE(two->parts_overlap);
  CHECK(solid_properties(two->mesh, 1.0).volume_m3 == Approx(0.3 * 0.1 * 0.1).epsilon(1e-6));
  CHECK(loader.changes().back() == a.string() + ": 2 parts are one body: their union");

  // The parts may be shells of one file. Alone, it is rejected, with this remedy.
  const std::string message = rejection_message<MeshError>([&] { loader.load(both, BodyKind::solid); });
  CHECK(message.find("meshes = [") != std::string::npos);
  const auto one = loader.load_parts({both}, BodyKind::solid);
  CHECK(solid_properties(one->mesh, 1.0).volume_m3 == Approx(2e-3 + 0.1 * 0.06 * 0.06).epsilon(1e-6));

  const auto surface = loader.load_parts({a, b}, BodyKind::surface);
  CHECK(surface->mesh.triangles.size() == 24);
  CHECK(rejection_message<MeshError>([&] {
          loader.load_parts({a, dir.write("open.off", as_off(tray()))}, BodyKind::solid);
        }).find("open.off: is not a closed") != std::string::npos);
}

TEST_CASE("a tool of parts meets a set of solids, and is never inside", "[tool]") {
  const TemporaryDirectory dir;
  SceneSettings settings;
  settings.tool.parts = {dir.write("a.off", as_off(box({0, 0, 0}, {0.04, 0.02, 0.02}))),
                         dir.write("b.off", as_off(box({0.03, 0, 0}, {0.05, 0.06, 0.02})))};
  settings.tool.mesh = settings.tool.parts[0];
  MeshObstacleSettings& obstacle = settings.meshes.emplace_back();
  obstacle.parts = {dir.write("c.off", as_off(box({-0.1, -0.1, -0.1}, {0.1, 0.02, 0}))),
                    dir.write("d.off", as_off(box({-0.1, 0.01, -0.1}, {0.1, 0.1, 0})))};
  obstacle.mesh = obstacle.parts[0];
  const Scene scene(settings);
  CHECK(scene.tool().solid.volume_m3 == Approx(0.04 * 0.02 * 0.02 + 0.02 * 0.06 * 0.02 - 0.01 * 0.02 * 0.02));
  Proxy proxy(scene);
  const double under_m = scene.tool().solid.p_MT_m.z();
  Pose X = {Quaterniond::Identity(), {0, 0, 0.1}};
  X = proxy.follow({Quaterniond::Identity(), {0, -0.05, -0.01}}, X).X_WQ;
  for (int i = 0; i <= 100; ++i)  // across the seam of the two parts of the obstacle
    X = proxy.follow({Quaterniond::Identity(), {0, -0.05 + 1e-3 * i, -0.01}}, X).X_WQ;
  CHECK((X.translation_m - Vector3d(0, 0.05, under_m)).norm() < 1e-5);
  FeasiblePoseSearch search(scene);
  CHECK_FALSE(search.admissible({Quaterniond::Identity(), {0, 0, -0.05}}));
}

}  // namespace
}  // namespace wrenchd::test_tools_of_any_kind
