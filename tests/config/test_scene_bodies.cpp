// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_scene.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd {
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

}  // namespace
}  // namespace wrenchd
