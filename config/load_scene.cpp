// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_scene.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "config/near_file.hpp"
#include "config/nearest_key.hpp"
#include "config/toml_reader.hpp"
#include "core/files/absolute_name.hpp"
#include "core/friction.hpp"
#include "core/generated_mesh.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr Range kScale = {1e-9, 1e6};
constexpr Range kMass = {1e-6, 1e6};
constexpr Range kSide = {1e-6, 100.0};
constexpr Range kAny = {-1e9, 1e9};
constexpr Range kRotation = {-10.0, 10.0};
constexpr Range kShellThickness_m = {1e-6, 1.0};
constexpr Range kTensor = {-1e6, 1e6};
constexpr Range kSurfaceTolerance_m = {0.0, 1e-3};
constexpr Range kReversal_s = {0.0, 86400.0};
constexpr Range kDensity_kg_per_m3 = {1e-3, 1e5};
constexpr Range kDamping_per_s = {0.0, 1e3};
constexpr Range kGravity_m_per_s2 = {-1000.0, 1000.0};
constexpr Range kFriction = {0.0, FrictionSettings::kMaxCoefficient};
constexpr Range kRestitution = {0.0, 1.0};

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

/// The scene that is read, and where its meshes may be.
struct SceneReading {
  SceneSettings& scene;
  const FileScope& scope;
};

/// Reads a mesh file name, or a table that describes a generated mesh.
void read_mesh(const TomlValue& value, const SceneReading& reading, fs::path& mesh,
               std::optional<GeneratedMesh>& generated) {
  if (value.is_table()) {
    value.table(read_generated, generated.emplace());
    mesh = generated_mesh_name(*generated);
    return;
  }
  if (!value.path(mesh)) return;
  mesh = reading.scene.file.parent_path() / mesh;
  // Outside of the scope the answer is the same whether the file exists or not.
  if (!reading.scope.contains(mesh))
    return value.reject("lies outside of the directories from which clients may load files (" +
                        reading.scope.directories_text() +
                        "); store it there, or let an administrator name it in the scene");
  std::error_code ignored;
  if (fs::is_regular_file(mesh, ignored)) return;
  const fs::path near = reading.scope.restricted() ? fs::path() : near_file(mesh);
  value.reject(
      "no such file; searched " + absolute_name(mesh).string() +
      (near.empty()
           ? "; name an OFF, OBJ, STL or PLY file, relative to this scene, or a mesh to generate, as "
             "in { make = \"gear\" }"
           : "; did you mean '" + near.lexically_normal().string() + "'?"));
}

/// Reads a list of mesh file names: the parts of one body. mesh: receives the first one.
void read_meshes(const TomlValue& list, const SceneReading& reading, fs::path& mesh,
                 std::vector<fs::path>& parts) {
  for (const TomlValue& value : list.elements("mesh file names, as in [\"a.stl\", \"b.stl\"]")) {
    if (value.is_table()) {
      value.reject("a list names files; a generated mesh stands alone, as in mesh = { make = \"gear\" }");
      continue;
    }
    std::optional<GeneratedMesh> none;
    fs::path part;
    read_mesh(value, reading, part, none);
    parts.push_back(std::move(part));
  }
  if (!list) return;
  if (parts.empty()) return list.reject("names no file; name the parts of the body, or use 'mesh'");
  mesh = parts.front();
}

/// Reads the key `mesh` or the key `meshes` of a body.
void read_shape(const TomlValue& mesh, const TomlValue& meshes, const SceneReading& reading, fs::path& file,
                std::optional<GeneratedMesh>& generated, std::vector<fs::path>& parts) {
  if (mesh && meshes) return meshes.reject("the body has a mesh already; keep one of 'mesh' and 'meshes'");
  if (meshes)
    read_meshes(meshes, reading, file, parts);
  else
    read_mesh(mesh, reading, file, generated);
}

void read_body_kind(const TomlValue& key, BodyKind& kind) {
  key.choice(kind, {{"solid", BodyKind::solid}, {"surface", BodyKind::surface}});
}

/// Reads the six numbers xx, yy, zz, xy, xz, yz. Rejects a tensor that no body has.
void read_tensor(const TomlValue& key, Matrix3d& H) {
  std::array<double, 6> n{};
  if (!key.numbers(n, kTensor)) return;
  Matrix3d tensor;
  tensor << n[0], n[3], n[4], n[3], n[1], n[5], n[4], n[5], n[2];
  const Vector3d principal = Eigen::SelfAdjointEigenSolver<Matrix3d>(tensor).eigenvalues();  // ascending
  constexpr double kRounding = 1e-6;
  if (!(principal[0] > 0.0))
    return key.reject("is no inertia: a principal moment is " + key.with_unit(principal[0]) +
                      "; give xx, yy, zz, xy, xz, yz about the centre of mass");
  if (principal[2] > (1.0 + kRounding) * (principal[0] + principal[1]))
    return key.reject(
        "is no inertia: the largest principal moment, " + key.with_unit(principal[2]) +
        ", exceeds the sum of the other two; give xx, yy, zz, xy, xz, yz about the centre of mass");
  H = tensor;
}

/// Reads what the inertia of the tool is that of. A surface has no volume, so its default is the convex hull.
void read_inertia(TomlTable& table, ToolSettings& tool) {
  const TomlValue source = table.optional("inertia");
  const TomlValue thickness = table.optional("shell_thickness_m");
  const TomlValue centre = table.optional("centre_of_mass_m");
  const TomlValue tensor = table.optional("inertia_kg_m2");
  if (tool.kind == BodyKind::surface) tool.inertia_source = InertiaSource::hull;
  source.choice(
      tool.inertia_source,
      {{"solid", InertiaSource::solid}, {"hull", InertiaSource::hull}, {"shell", InertiaSource::shell}});
  if (tool.kind == BodyKind::surface && tool.inertia_source == InertiaSource::solid)
    source.reject(
        "a surface has no volume; use \"hull\", \"shell\" with shell_thickness_m, or inertia_kg_m2 with "
        "centre_of_mass_m");
  const bool shell = tool.inertia_source == InertiaSource::shell;
  thickness.number(tool.shell_thickness_m, kShellThickness_m);
  if (thickness && !shell) thickness.reject("belongs to inertia = \"shell\"; add it, or leave this out");
  if (shell && !thickness) source.reject("needs shell_thickness_m, the thickness of the shell");
  if (static_cast<bool>(centre) != static_cast<bool>(tensor))
    (centre ? centre : tensor)
        .reject("centre_of_mass_m and inertia_kg_m2 belong together; give both, or use inertia = \"hull\"");
  centre.vector(tool.centre_of_mass_m, kAny);
  read_tensor(tensor, tool.inertia_kg_m2);
  if (!centre || !tensor) return;
  if (source) return source.reject("inertia_kg_m2 gives the inertia already; keep one of the two");
  tool.inertia_source = InertiaSource::given;
}

/// Reads shape, inertia and mass of the tool or of a body. Returns the key of the mass.
TomlValue read_solid(TomlTable& table, const SceneReading& reading, ToolSettings& solid) {
  const TomlValue meshes = table.optional("meshes");
  read_shape(table.mandatory_unless("meshes", "mesh"), meshes, reading, solid.mesh, solid.generated,
             solid.parts);
  read_body_kind(table.optional("kind"), solid.kind);
  read_inertia(table, solid);
  table.optional("scale", "m").number(solid.scale, kScale);
  TomlValue mass = table.optional("mass", "kg");
  mass.number(solid.mass_kg, kMass);
  return mass;
}

/// The mass may be in [tool] or at the top of the file.
void read_scene_tool(TomlTable& table, const SceneReading& reading, const TomlValue& top_mass) {
  SceneSettings& scene = reading.scene;
  const TomlValue mass = read_solid(table, reading, scene.tool);
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

void read_mesh_obstacle(const TomlValue& mesh, const TomlValue& meshes, const MeshKeys& keys,
                        const SceneReading& reading, const std::string& name) {
  MeshObstacleSettings obstacle;
  obstacle.name = name;
  read_shape(mesh, meshes, reading, obstacle.mesh, obstacle.generated, obstacle.parts);
  keys.scale.number(obstacle.scale, kScale);
  keys.position.vector(obstacle.X_WM.translation_m, kAny);
  Vector3d rotation_vector_rad = Vector3d::Zero();
  keys.rotation.vector(rotation_vector_rad, kRotation);
  obstacle.X_WM.rotation = rotation_from(rotation_vector_rad);
  read_body_kind(keys.kind, obstacle.kind);
  read_motion(keys, obstacle.motion);
  reading.scene.meshes.push_back(obstacle);
}

/// Each obstacle has one shape: half_space, mesh or meshes.
void read_obstacle(TomlTable& table, const SceneReading& reading, const std::string& place) {
  std::string name = place;
  table.optional("name").text(name);
  const TomlValue mesh = table.optional("mesh"), meshes = table.optional("meshes");
  const TomlValue half_space =
      meshes ? table.optional("half_space") : table.mandatory_unless("mesh", "half_space");
  const MeshKeys keys = {table.optional("scale", "m"),          table.optional("position_m"),
                         table.optional("rotation_vector_rad"), table.optional("kind"),
                         table.optional("velocity_m_per_s"),    table.optional("angular_velocity_rad_per_s"),
                         table.optional("reverse_after_s")};
  if (mesh || meshes) {
    if (half_space)
      half_space.reject("the obstacle has a mesh already; give each shape an [[obstacle]] of its own");
    return read_mesh_obstacle(mesh, meshes, keys, reading, name);
  }
  if (keys.kind) keys.kind.reject("belongs to a mesh; a half_space is solid");
  for (const TomlValue& key : {keys.scale, keys.position, keys.rotation})
    if (key) key.reject("belongs to a mesh; a half_space is defined by normal and offset");
  for (const TomlValue& key : {keys.velocity, keys.angular_velocity, keys.reverse_after})
    if (key) key.reject("belongs to a mesh; a half_space cannot move; use a mesh for a moving obstacle");
  HalfSpaceSettings settings{name, Vector3d::UnitZ(), 0.0};
  half_space.table(read_half_space, settings);
  if (half_space) reading.scene.half_spaces.push_back(settings);
}

/// Returns what in the scene has a name: "an obstacle", "a body", or nothing.
std::string_view owner_of(const SceneSettings& scene, const std::string& name) {
  const auto has_it = [&name](const auto& one) { return one.name == name; };
  if (std::any_of(scene.bodies.begin(), scene.bodies.end(), has_it)) return "a body";
  const bool obstacle = std::any_of(scene.half_spaces.begin(), scene.half_spaces.end(), has_it) ||
                        std::any_of(scene.meshes.begin(), scene.meshes.end(), has_it);
  return obstacle ? "an obstacle" : "";
}

/// Rejects a name that is taken. Clients and the page name obstacles and bodies.
void reject_taken(const TomlValue& key, const SceneSettings& scene, const std::string& name) {
  const std::string_view owner = owner_of(scene, name);
  if (owner.empty()) return;
  key.reject("there is " + std::string(owner) + " '" + name +
             "' already; give this one another name, or remove that one");
}

/// Reads a body that moves by itself.
void read_body(TomlTable& table, const SceneReading& reading, const std::string& place) {
  BodySettings body;
  body.name = place;
  const TomlValue name = table.optional("name");
  if (name.text(body.name)) reject_taken(name, reading.scene, body.name);
  const TomlValue mass = read_solid(table, reading, body.shape);
  const TomlValue density = table.optional("density_kg_per_m3");
  if (double value = 0.0; density.number(value, kDensity_kg_per_m3)) body.density_kg_per_m3 = value;
  if (mass && density)
    density.reject("the body has a mass already; keep one of 'mass' and 'density_kg_per_m3'");
  if (density && body.shape.inertia_source != InertiaSource::solid)
    density.reject("needs the volume of a solid; give 'mass' to a body with another inertia");
  table.optional("position_m").vector(body.X_WM.translation_m, kAny);
  Vector3d rotation_vector_rad = Vector3d::Zero();
  table.optional("rotation_vector_rad").vector(rotation_vector_rad, kRotation);
  body.X_WM.rotation = rotation_from(rotation_vector_rad);
  read_velocity(table.optional("velocity_m_per_s"), ObstacleMotion::kMaxSpeed_m_per_s, body.velocity_m_per_s);
  read_velocity(table.optional("angular_velocity_rad_per_s"), ObstacleMotion::kMaxAngularSpeed_rad_per_s,
                body.spin_rad_per_s);
  table.optional("friction").number(body.friction, kFriction);
  table.optional("restitution").number(body.restitution, kRestitution);
  table.optional("linear_damping_per_s").number(body.linear_damping_per_s, kDamping_per_s);
  table.optional("angular_damping_per_s").number(body.angular_damping_per_s, kDamping_per_s);
  reading.scene.bodies.push_back(std::move(body));
}

void read_bodies(TomlTable& table, const SceneReading& reading) {
  const TomlValue gravity = table.optional("gravity_m_per_s2");
  gravity.vector(reading.scene.gravity_W_m_per_s2, kGravity_m_per_s2);
  const TomlValue bodies = table.optional("body");
  if (gravity && !bodies)
    gravity.reject("acts on free bodies, and the scene has none; add a [[body]], or leave this out");
  for (const TomlValue& body : bodies.elements("tables, each headed [[body]]"))
    body.table(read_body, reading, body.name());
  if (reading.scene.bodies.size() > SceneSettings::kMaxBodies)
    bodies.reject("has " + std::to_string(reading.scene.bodies.size()) + " bodies; a scene may have " +
                  std::to_string(SceneSettings::kMaxBodies));
}

void read_scene(TomlTable& table, const SceneReading& reading) {
  SceneSettings& scene = reading.scene;
  table.foreign({"description", "scene", "device", "servo", "rendering", "wrench", "limits", "simulation",
                 "recording", "control", "view", "hand"},
                "this is a configuration, which names its scene: give the file that its key 'scene' names");
  TomlValue mass = table.optional("mass", "kg");
  table.optional("surface_tolerance_m").number(scene.surface_tolerance_m, kSurfaceTolerance_m);
  table.mandatory("tool").table(read_scene_tool, reading, mass);
  for (const TomlValue& obstacle : table.optional("obstacle").elements("tables, each headed [[obstacle]]")) {
    obstacle.table(read_obstacle, reading, obstacle.name());
  }
  read_bodies(table, reading);
}

/// Reads an added obstacle. It needs a unique name, because clients move and remove it by name.
void read_added(TomlTable& table, const SceneReading& reading) {
  const SceneSettings& scene = reading.scene;
  std::string name;
  const TomlValue key = table.optional("name");
  if (key.text(name)) reject_taken(key, scene, name);
  for (std::size_t i = scene.half_spaces.size() + scene.meshes.size(); name.empty(); ++i)
    if (const std::string free = "obstacle[" + std::to_string(i) + "]"; owner_of(scene, free).empty())
      name = free;
  read_obstacle(table, reading, name);
}

}  // namespace

void read_tool(TomlTable& table, const fs::path& file, ToolSettings& tool) {
  SceneSettings scene;
  scene.file = file;
  read_solid(table, SceneReading{scene, FileScope()}, tool);
}

void add_obstacle(const TomlNode& obstacle, const fs::path& source, SceneSettings& scene,
                  const FileScope& scope) {
  SceneSettings extended = scene;
  read_toml_node(source, obstacle, read_added, SceneReading{extended, scope});
  scene = std::move(extended);
}

SceneSettings load_scene(const std::filesystem::path& file, const FileScope& scope) {
  std::string text = read_config_text(file, scope);
  SceneSettings scene = load_scene(read_toml_text(text, file), file, scope);
  scene.text = std::move(text);
  return scene;
}

SceneSettings load_scene(const TomlNode& tree, const std::filesystem::path& file, const FileScope& scope) {
  SceneSettings scene;
  scene.file = file;
  read_toml_node(file, tree, read_scene, SceneReading{scene, scope});
  return scene;
}

}  // namespace wrenchd
