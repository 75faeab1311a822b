// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_scene.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "config/nearest_key.hpp"
#include "config/toml_reader.hpp"
#include "core/generated_mesh.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr Range kScale = {1e-9, 1e6};
constexpr Range kMass = {1e-6, 1e6};
constexpr Range kSide = {1e-6, 100.0};
constexpr Range kAny = {-1e9, 1e9};
constexpr Range kRotation = {-10.0, 10.0};
constexpr Range kSurfaceTolerance_m = {0.0, 1e-3};
constexpr Range kReversal_s = {0.0, 86400.0};

/// A shorter normal is a typing mistake.
constexpr double kMinNormal = 1e-9;

void read_kind(const TomlValue& value, GeneratedMesh& generated) {
  if (!value.text(generated.kind)) return;
  std::vector<KnownKey> known;
  for (const MeshKind& kind : mesh_kinds()) known.push_back({kind.name, ""});
  if (std::any_of(known.begin(), known.end(),
                  [&](const KnownKey& key) { return key.name == generated.kind; }))
    return;
  const NearestKey nearest = nearest_key(generated.kind, known);
  std::string all;
  for (const KnownKey& key : known) all += (all.empty() ? "" : ", ") + key.name;
  value.reject("no generated mesh of kind '" + printable(generated.kind) + "'; " +
               (nearest.name.empty() ? "there are " + all : nearest.advice));
}

void read_generated(TomlTable& table, GeneratedMesh& generated) {
  read_kind(table.mandatory("make"), generated);
  table.optional("triangles")
      .integer(generated.triangles, {static_cast<double>(GeneratedMesh::kMinTriangles),
                                     static_cast<double>(GeneratedMesh::kMaxTriangles)});
  const TomlValue seed = table.optional("seed");
  seed.integer(generated.seed, {0, 4294967295.0});
  if (seed && generated.kind != "bumpy" && generated.kind != "boulder")
    seed.reject("only bumpy and boulder are random; leave it out");
  const TomlValue size = table.optional("size_m");
  size.vector(generated.size_m, kSide);
  if (size && generated.kind != "box")
    size.reject("only a box has sides that can be chosen; use 'scale', beside 'mesh'");
}

/// Reads a mesh file name, or a table that describes a generated mesh.
void read_mesh(const TomlValue& value, const SceneSettings& scene, fs::path& mesh,
               std::optional<GeneratedMesh>& generated) {
  if (value.is_table()) {
    value.table(read_generated, generated.emplace());
    mesh = generated_mesh_name(*generated);
    return;
  }
  if (!value.path(mesh)) return;
  mesh = scene.file.parent_path() / mesh;
  std::error_code ignored;
  if (fs::is_regular_file(mesh, ignored)) return;
  value.reject(
      "no such file; searched " + fs::absolute(mesh).lexically_normal().string() +
      "; name an OFF, OBJ, STL or PLY file, relative to this scene, or a mesh to generate, as in { make "
      "= \"gear\" }");
}

/// The mass may be in [tool] or at the top of the file.
void read_tool(TomlTable& table, SceneSettings& scene, const TomlValue& top_mass) {
  read_mesh(table.mandatory("mesh"), scene, scene.tool.mesh, scene.tool.generated);
  table.optional("scale", "m").number(scene.tool.scale, kScale);
  const TomlValue mass = table.optional("mass", "kg");
  mass.number(scene.tool.mass_kg, kMass);
  top_mass.number(scene.tool.mass_kg, kMass);
  if (mass && top_mass) mass.reject("is also given at the top of the file; keep one of the two");
}

/// Reads normal . x < offset. Scales normal and offset to a unit normal, so the set of points does not
/// change.
void read_half_space(TomlTable& table, HalfSpaceSettings& half_space) {
  table.mandatory("offset", "m").number(half_space.offset_m, kAny);
  const TomlValue normal = table.mandatory("normal");
  if (!normal.vector(half_space.normal_W, kAny)) return;
  const double length = half_space.normal_W.norm();
  if (length < kMinNormal) return normal.reject("must not be zero; it points out of the solid");
  half_space.normal_W /= length;
  half_space.offset_m /= length;
}

/// Keys that require `mesh`; a half-space rejects them.
struct MeshKeys {
  TomlValue scale, position, rotation, kind;
  TomlValue velocity, angular_velocity, reverse_after;
};

/// Reads a velocity and rejects a length above `fastest`. Returns true if the key is valid or absent.
bool read_velocity(const TomlValue& key, double fastest, Vector3d& velocity) {
  if (!key) return true;
  if (!key.vector(velocity, {-fastest, fastest})) return false;
  const double speed = velocity.norm();
  if (speed <= fastest) return true;
  key.reject("has the length " + key.with_unit(speed) + "; give one of no more than " +
             key.with_unit(fastest));
  return false;
}

void read_motion(const MeshKeys& keys, ObstacleMotion& motion) {
  const bool linear_is_good =
      read_velocity(keys.velocity, ObstacleMotion::kMaxSpeed_m_per_s, motion.linear_m_per_s);
  const bool angular_is_good = read_velocity(
      keys.angular_velocity, ObstacleMotion::kMaxAngularSpeed_rad_per_s, motion.angular_rad_per_s);
  const bool reverses = keys.reverse_after.number(motion.reverse_after_s, kReversal_s);
  if (reverses && linear_is_good && angular_is_good && !motion.moves())
    keys.reverse_after.reject(
        "the obstacle does not move; give it velocity_m_per_s or angular_velocity_rad_per_s, or leave this "
        "out");
}

void read_mesh_obstacle(const TomlValue& mesh, const MeshKeys& keys, SceneSettings& scene,
                        const std::string& name) {
  MeshObstacleSettings obstacle;
  obstacle.name = name;
  read_mesh(mesh, scene, obstacle.mesh, obstacle.generated);
  keys.scale.number(obstacle.scale, kScale);
  keys.position.vector(obstacle.X_WM.translation_m, kAny);
  Vector3d rotation_vector_rad = Vector3d::Zero();
  keys.rotation.vector(rotation_vector_rad, kRotation);
  obstacle.X_WM.rotation = rotation_from(rotation_vector_rad);
  keys.kind.choice(obstacle.kind, {{"solid", BodyKind::solid}, {"surface", BodyKind::surface}});
  read_motion(keys, obstacle.motion);
  scene.meshes.push_back(obstacle);
}

/// Each obstacle has one shape: half_space or mesh.
void read_obstacle(TomlTable& table, SceneSettings& scene, const std::string& place) {
  std::string name = place;
  table.optional("name").line(name);
  const TomlValue mesh = table.optional("mesh");
  const TomlValue half_space = table.mandatory_unless("mesh", "half_space");
  const MeshKeys keys = {table.optional("scale", "m"),          table.optional("position_m"),
                         table.optional("rotation_vector_rad"), table.optional("kind"),
                         table.optional("velocity_m_per_s"),    table.optional("angular_velocity_rad_per_s"),
                         table.optional("reverse_after_s")};
  if (mesh) {
    if (half_space)
      half_space.reject("the obstacle has a mesh already; give each shape an [[obstacle]] of its own");
    return read_mesh_obstacle(mesh, keys, scene, name);
  }
  if (keys.kind) keys.kind.reject("belongs to a mesh; a half_space is solid");
  for (const TomlValue& key : {keys.scale, keys.position, keys.rotation})
    if (key) key.reject("belongs to a mesh; a half_space is defined by normal and offset");
  for (const TomlValue& key : {keys.velocity, keys.angular_velocity, keys.reverse_after})
    if (key) key.reject("belongs to a mesh; a half_space cannot move; use a mesh for a moving obstacle");
  HalfSpaceSettings settings{name, Vector3d::UnitZ(), 0.0};
  half_space.table(read_half_space, settings);
  if (half_space) scene.half_spaces.push_back(settings);
}

void read_scene(TomlTable& table, SceneSettings& scene) {
  const TomlValue mass = table.optional("mass", "kg");
  table.optional("surface_tolerance_m").number(scene.surface_tolerance_m, kSurfaceTolerance_m);
  table.mandatory("tool").table(read_tool, scene, mass);
  for (const TomlValue& obstacle : table.optional("obstacle").elements("tables, each headed [[obstacle]]")) {
    obstacle.table(read_obstacle, scene, obstacle.name());
  }
}

bool has_name(const SceneSettings& scene, const std::string& name) {
  const auto has_it = [&name](const auto& obstacle) { return obstacle.name == name; };
  return std::any_of(scene.half_spaces.begin(), scene.half_spaces.end(), has_it) ||
         std::any_of(scene.meshes.begin(), scene.meshes.end(), has_it);
}

/// Reads an added obstacle. It needs a unique name, because clients move and remove it by name.
void read_added(TomlTable& table, SceneSettings& scene) {
  std::string name;
  const TomlValue key = table.optional("name");
  if (key.line(name) && has_name(scene, name))
    key.reject("there is an obstacle '" + name + "' already; give this one another name, or remove that one");
  for (std::size_t i = scene.half_spaces.size() + scene.meshes.size(); name.empty(); ++i)
    if (const std::string free = "obstacle[" + std::to_string(i) + "]"; !has_name(scene, free)) name = free;
  read_obstacle(table, scene, name);
}

const TomlEntry* find(const TomlNode& table, const std::string& key) {
  const auto* entries = std::get_if<TomlNode::Table>(&table.value);
  if (entries == nullptr) return nullptr;
  for (const TomlEntry& entry : *entries)
    if (entry.key == key) return &entry;
  return nullptr;
}

/// Rejects a body whose mesh file is outside the scope, before the file is looked for: whether a file outside
/// exists is not told.
void require_mesh_in_scope(const TomlNode& body, const fs::path& source, const fs::path& directory,
                           const FileScope& scope) {
  const TomlEntry* const mesh = find(body, "mesh");
  const auto* const name = mesh == nullptr ? nullptr : std::get_if<std::string>(&mesh->node.value);
  if (name == nullptr || scope.includes(directory / *name)) return;
  throw ConfigError(source, {},
                    "the mesh '" + printable(*name) + "' is outside the directories that you may use: " +
                        scope.text() + "; only administrators may name other files");
}

void require_meshes_in_scope(const TomlNode& tree, const fs::path& file, const FileScope& scope) {
  if (!scope.is_limited()) return;
  if (const TomlEntry* const tool = find(tree, "tool"))
    require_mesh_in_scope(tool->node, file, file.parent_path(), scope);
  const TomlEntry* const obstacles = find(tree, "obstacle");
  const auto* const list =
      obstacles == nullptr ? nullptr : std::get_if<TomlNode::Array>(&obstacles->node.value);
  if (list == nullptr) return;
  for (const TomlNode& obstacle : *list) require_mesh_in_scope(obstacle, file, file.parent_path(), scope);
}

}  // namespace

void add_obstacle(const TomlNode& obstacle, const fs::path& source, SceneSettings& scene,
                  const FileScope& scope) {
  if (scope.is_limited()) require_mesh_in_scope(obstacle, source, scene.file.parent_path(), scope);
  SceneSettings extended = scene;
  read_toml_node(source, obstacle, read_added, extended);
  scene = std::move(extended);
}

SceneSettings load_scene(const std::filesystem::path& file, LoadedTexts* texts, const FileScope& scope) {
  const TomlNode tree = read_toml_file(file, scope, texts);
  require_meshes_in_scope(tree, file, scope);
  return load_scene(tree, file);
}

SceneSettings load_scene(const TomlNode& tree, const std::filesystem::path& file) {
  SceneSettings scene;
  scene.file = file;
  read_toml_node(file, tree, read_scene, scene);
  return scene;
}

}  // namespace wrenchd
