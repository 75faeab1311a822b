// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_scene.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_scene_bodies {

namespace {

namespace fs = std::filesystem;
using namespace test;

SceneSettings load(const TemporaryDirectory& dir, const std::string& text) {
  for (const char* mesh : {"a.stl", "b.stl"}) dir.write(mesh, "solid\nendsolid\n");
  return load_scene(dir.write("scene.toml", text));
}

std::string rejection(const TemporaryDirectory& dir, const std::string& text) {
  return rejection_message<ConfigError>([&] { load(dir, text); });
}

TEST_CASE("a tool may be a surface, and its inertia that of the hull, of a shell, or given", "[scene]") {
  const TemporaryDirectory dir;
  const SceneSettings hull = load(dir, "[tool]\nmesh = \"a.stl\"\nkind = \"surface\"\n");
  CHECK(hull.tool.kind == BodyKind::surface);
  CHECK(hull.tool.inertia_source == InertiaSource::hull);
  CHECK(load(dir, "[tool]\nmesh = \"a.stl\"\n").tool.inertia_source == InertiaSource::solid);
  const SceneSettings shell = load(
      dir, "[tool]\nmesh = \"a.stl\"\nkind = \"surface\"\ninertia = \"shell\"\nshell_thickness_m = 0.002\n");
  CHECK(shell.tool.inertia_source == InertiaSource::shell);
  CHECK(shell.tool.shell_thickness_m == 0.002);
  const SceneSettings given =
      load(dir,
           "[tool]\nmesh = \"a.stl\"\nkind = \"surface\"\nmass = 0.2\ncentre_of_mass_m = [0.1, 0.2, 0.3]\n"
           "inertia_kg_m2 = [3e-4, 4e-4, 5e-4, 1e-5, 2e-5, 3e-5]\n");
  CHECK(given.tool.inertia_source == InertiaSource::given);
  CHECK(given.tool.centre_of_mass_m == Vector3d(0.1, 0.2, 0.3));
  Matrix3d H;
  H << 3e-4, 1e-5, 2e-5, 1e-5, 4e-4, 3e-5, 2e-5, 3e-5, 5e-4;
  CHECK(given.tool.inertia_kg_m2 == H);
}

TEST_CASE("an inertia that no body has, or half of one, is rejected", "[scene]") {
  const TemporaryDirectory dir;
  const std::string tool = "[tool]\nmesh = \"a.stl\"\nkind = \"surface\"\n";
  const auto rejects = [&](const std::string& lines, const std::string& words) {
    const std::string message = rejection(dir, tool + lines);
    INFO(lines << message);
    CHECK(message.find(words) != std::string::npos);
  };
  rejects("inertia = \"solid\"\n", "a surface has no volume");
  rejects("inertia = \"shell\"\n", "needs shell_thickness_m");
  rejects("shell_thickness_m = 0.1\n", "belongs to inertia = \"shell\"");
  rejects("centre_of_mass_m = [0, 0, 0]\n", "give both");
  rejects("centre_of_mass_m = [0, 0, 0]\ninertia_kg_m2 = [1, 1, 3, 0, 0, 0]\n",
          "exceeds the sum of the other two");
  rejects("centre_of_mass_m = [0, 0, 0]\ninertia_kg_m2 = [1, -1, 1, 0, 0, 0]\n", "a principal moment is");
  rejects("centre_of_mass_m = [0, 0, 0]\ninertia_kg_m2 = [1, 1, 1, 0, 0, 0]\ninertia = \"hull\"\n",
          "keep one of the two");
}

TEST_CASE("a body may consist of several meshes", "[scene]") {
  const TemporaryDirectory dir;
  const SceneSettings scene = load(
      dir,
      "[tool]\nmeshes = [\"a.stl\", \"b.stl\"]\n[[obstacle]]\nmeshes = [\"b.stl\"]\nkind = \"surface\"\n");
  REQUIRE(scene.tool.parts.size() == 2);
  CHECK(scene.tool.mesh == dir.path() / "a.stl");
  CHECK(scene.tool.parts[1] == dir.path() / "b.stl");
  REQUIRE(scene.meshes.size() == 1);
  CHECK(mesh_files(scene.meshes[0]) == std::vector<fs::path>{dir.path() / "b.stl"});
  CHECK(mesh_files(scene.tool) == scene.tool.parts);
  CHECK(rejection(dir, "[tool]\nmesh = \"a.stl\"\nmeshes = [\"b.stl\"]\n").find("keep one of") !=
        std::string::npos);
  CHECK(rejection(dir, "[tool]\nmeshes = []\n").find("names no file") != std::string::npos);
  CHECK(rejection(dir, "[tool]\nmeshes = [\"c.stl\"]\n").find("no such file") != std::string::npos);
  CHECK(rejection(dir, "[tool]\nmeshes = [{ make = \"gear\" }]\n").find("stands alone") != std::string::npos);
  CHECK(rejection(dir, "[tool]\nscale = 1\n").find("'tool.mesh'") != std::string::npos);
}

TEST_CASE("a scene may have free bodies", "[scene]") {
  const TemporaryDirectory dir;
  const std::string tool = "[tool]\nmesh = \"a.stl\"\n";
  const SceneSettings scene = load(
      dir, "gravity_m_per_s2 = [0.0, 0.0, -1.62]\n" + tool +
               "[[body]]\nname = \"crate\"\nmesh = \"b.stl\"\nscale = 0.001\ndensity_kg_per_m3 = 700.0\n"
               "position_m = [0.1, 0.2, 0.3]\nrotation_vector_rad = [0.0, 0.0, 0.5]\n"
               "velocity_m_per_s = [1.0, 0.0, 0.0]\nangular_velocity_rad_per_s = [0.0, 2.0, 0.0]\n"
               "friction = 0.3\nrestitution = 0.6\nlinear_damping_per_s = 0.1\nangular_damping_per_s = 0.2\n"
               "[[body]]\nmesh = { make = \"gear\" }\nmass = 0.4\n");
  REQUIRE(scene.bodies.size() == 2);
  const BodySettings& crate = scene.bodies[0];
  CHECK(scene.gravity_W_m_per_s2 == Vector3d(0.0, 0.0, -1.62));
  CHECK(crate.name == "crate");
  CHECK(crate.density_kg_per_m3 == 700.0);
  CHECK(crate.X_WM.translation_m == Vector3d(0.1, 0.2, 0.3));
  CHECK(crate.X_WM.rotation.angularDistance(Quaterniond::Identity()) == Approx(0.5));
  CHECK(crate.velocity_m_per_s == Vector3d(1.0, 0.0, 0.0));
  CHECK(crate.spin_rad_per_s == Vector3d(0.0, 2.0, 0.0));
  CHECK(crate.friction == 0.3);
  CHECK(crate.restitution == 0.6);
  CHECK(crate.linear_damping_per_s == 0.1);
  CHECK(crate.angular_damping_per_s == 0.2);
  CHECK(scene.bodies[1].name == "body[1]");
  CHECK(scene.bodies[1].shape.mass_kg == 0.4);
  CHECK(load(dir, tool + "[[body]]\nmesh = \"b.stl\"\n").gravity_W_m_per_s2 == Vector3d(0.0, 0.0, -9.81));
}

TEST_CASE("a free body with an error is rejected with its place and the remedy", "[scene]") {
  const TemporaryDirectory dir;
  const std::string tool = "[tool]\nmesh = \"a.stl\"\n", body = "[[body]]\nmesh = \"b.stl\"\n";
  const auto says = [&](const std::string& text, const std::string& reason) {
    INFO(text);
    CHECK_THAT(rejection(dir, text), Catch::Contains(reason));
  };
  says(tool + body + "mass = 1.0\ndensity_kg_per_m3 = 700.0\n", "keep one of 'mass' and 'density_kg_per_m3'");
  says(tool + body + "inertia = \"hull\"\ndensity_kg_per_m3 = 700.0\n", "needs the volume of a solid");
  says(tool + body + "friction = -0.1\n", "friction");
  says(tool + body + "restitution = 1.1\n", "a number from 0 to 1");
  says(tool + body + "velocity_m_per_s = [9.0, 0.0, 0.0]\n", "a number from -5 to 5 m/s, found 9");
  says(tool + "[[body]]\nmass = 1.0\n", "mesh");
  says(tool + "[[body]]\nname = \"b\"\nmesh = \"b.stl\"\n[[body]]\nname = \"b\"\nmesh = \"b.stl\"\n",
       "there is a body 'b' already; give this one another name");
  says("gravity_m_per_s2 = [0.0, 0.0, -9.81]\n" + tool, "the scene has none; add a [[body]]");
  std::string nine = tool;
  for (int i = 0; i < 9; ++i) nine += body;
  says(nine, "has 9 bodies; a scene may have 8");
}

}  // namespace
}  // namespace wrenchd::test_scene_bodies
