// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_scene.hpp"

#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr Range kScale = {1e-9, 1e6};
constexpr Range kMass = {1e-6, 1e6};
constexpr Range kAny = {-1e9, 1e9};

/// Shorter than this a normal is a slip of the keyboard rather than a direction.
constexpr double kMinNormal = 1e-9;

void read_mesh(const TomlValue& value, const SceneSettings& scene, fs::path& mesh) {
  if (!value.path(mesh)) return;
  mesh = scene.file.parent_path() / mesh;
  std::error_code ignored;
  if (fs::is_regular_file(mesh, ignored)) return;
  value.refuse("no such file; looked for " + fs::absolute(mesh).lexically_normal().string() +
               "; name an OFF, OBJ, STL or PLY file, relative to this scene");
}

/// The mass may stand in [tool] or at the top of the file.
void read_tool(TomlTable& table, SceneSettings& scene, const TomlValue& top_mass) {
  read_mesh(table.mandatory("mesh"), scene, scene.tool.mesh);
  table.optional("scale", "m").number(scene.tool.scale, kScale);
  const TomlValue mass = table.optional("mass", "kg");
  mass.number(scene.tool.mass_kg, kMass);
  top_mass.number(scene.tool.mass_kg, kMass);
  if (mass && top_mass) mass.refuse("is also given at the top of the file; keep one of the two");
}

/// Solid where normal . x < offset. A normal of another length is made unit, and the offset with it, so that
/// the solid stays the same set of points.
void read_half_space(TomlTable& table, HalfSpaceSettings& half_space) {
  table.mandatory("offset", "m").number(half_space.offset_m, kAny);
  const TomlValue normal = table.mandatory("normal");
  if (!normal.vector(half_space.normal_W, kAny)) return;
  const double length = half_space.normal_W.norm();
  if (length < kMinNormal) return normal.refuse("must not be zero; it points out of the solid");
  half_space.normal_W /= length;
  half_space.offset_m /= length;
}

/// Other shapes get their key beside half_space.
void read_obstacle(TomlTable& table, SceneSettings& scene, const std::string& place) {
  HalfSpaceSettings half_space{place, Vector3d::UnitZ(), 0.0};
  table.optional("name").text(half_space.name);
  const TomlValue mesh = table.optional("mesh");
  if (mesh) mesh.refuse("mesh obstacles are not supported yet; give a half_space");
  table.mandatory("half_space").table(read_half_space, half_space);
  scene.half_spaces.push_back(half_space);
}

void read_scene(TomlTable& table, SceneSettings& scene) {
  const TomlValue mass = table.optional("mass", "kg");
  table.mandatory("tool").table(read_tool, scene, mass);
  for (const TomlValue& obstacle : table.optional("obstacle").elements("tables, each headed [[obstacle]]")) {
    obstacle.table(read_obstacle, scene, obstacle.name());
  }
}

}  // namespace

SceneSettings load_scene(const std::filesystem::path& file) {
  SceneSettings scene;
  scene.file = file;
  read_toml(file, read_scene, scene);
  return scene;
}

}  // namespace wrenchd
