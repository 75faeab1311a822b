// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recorded_inputs.hpp"

#include <chrono>
#include <fstream>

#include <sys/utsname.h>

#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "daemon/version.hpp"
#include "daemon/wall_clock.hpp"
#include "files/opened_file.hpp"
#include "files/sha256.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Largest mesh file that a replay reads from its original path.
constexpr std::uint64_t kMaxMesh_bytes = std::uint64_t{1} << 30;

const char* word(Realtime realtime) {
  switch (realtime) {
    case Realtime::required:
      return "required";
    case Realtime::best_effort:
      return "best_effort";
    case Realtime::off:
      break;
  }
  return "off";
}

const RecordedFile* find(const RecordingHeader& header, const std::string& role) {
  for (const RecordedFile& file : header.files)
    if (file.role == role) return &file;
  return nullptr;
}

void write(const fs::path& file, const std::string& bytes) {
  fs::create_directories(file.parent_path());
  std::ofstream out(file, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) throw RecordingError(file.string() + ": cannot write a file of the recording; is the disk full?");
}

/// Returns the path of a mesh: of the unpacked copy, or the original path. Throws RecordingError.
fs::path mesh_at(const RecordingHeader& header, const std::string& role, const fs::path& directory) {
  const RecordedFile* const mesh = find(header, role);
  if (mesh == nullptr)
    throw RecordingError("the recording does not contain the mesh '" + role +
                         "', which its scene names; name the scene with --scene and the configuration with "
                         "--config");
  if (mesh->embedded) {
    const fs::path file = directory / "meshes" / (role + mesh->path.extension().string());
    write(file, mesh->bytes);
    return file;
  }
  std::string why;
  try {
    if (sha256_hex(read_file(mesh->path, kMaxMesh_bytes)) != mesh->sha256)
      why = "has changed since it was recorded";
  } catch (const FileError& error) {
    why = error.reason() == FileError::Reason::not_found ? "does not exist any more" : error.what();
  }
  if (!why.empty())
    throw RecordingError(mesh->path.string() + ": " + why + " (SHA-256 " + mesh->sha256 +
                         "), and the recording does not contain it; restore the file");
  return mesh->path;
}

TomlEntry* find(TomlNode& table, const std::string& key) {
  auto* entries = std::get_if<TomlNode::Table>(&table.value);
  if (entries == nullptr) return nullptr;
  for (TomlEntry& entry : *entries)
    if (entry.key == key) return &entry;
  return nullptr;
}

TomlNode& add(TomlNode::Table& table, const std::string& key) {
  table.emplace_back().key = key;
  return table.back().node;
}

/// Sets key = value in a table, and replaces a previous value. Does nothing if `table` is null.
void set(TomlNode* table, const std::string& key, const std::string& value) {
  if (table == nullptr) return;
  if (TomlEntry* const entry = find(*table, key)) {
    entry->node.value = value;
    return;
  }
  if (auto* entries = std::get_if<TomlNode::Table>(&table->value)) add(*entries, key).value = value;
}

/// Returns the table `key` of a table, and creates it if it is missing.
TomlNode* table_in(TomlNode& root, const std::string& key) {
  if (TomlEntry* const entry = find(root, key)) return &entry->node;
  auto* entries = std::get_if<TomlNode::Table>(&root.value);
  if (entries == nullptr) return nullptr;
  TomlNode& made = add(*entries, key);
  made.value = TomlNode::Table{};
  return &made;
}

/// Replaces the mesh path of a body by the path of the unpacked file. Leaves a generated mesh unchanged.
void put_mesh(TomlNode& body, const RecordingHeader& header, const std::string& role,
              const fs::path& directory) {
  TomlEntry* const mesh = find(body, "mesh");
  if (mesh != nullptr && std::holds_alternative<std::string>(mesh->node.value))
    mesh->node.value = mesh_at(header, role, directory).string();
}

SceneSettings scene_of(const RecordingHeader& header, const fs::path& directory) {
  TomlNode tree = read_toml_text(header.scene, header.scene_file);
  if (TomlEntry* const tool = find(tree, "tool")) put_mesh(tool->node, header, "tool", directory);
  int number = 0;
  if (TomlEntry* const obstacles = find(tree, "obstacle"))
    if (auto* list = std::get_if<TomlNode::Array>(&obstacles->node.value))
      for (TomlNode& obstacle : *list)
        if (find(obstacle, "mesh") != nullptr)
          put_mesh(obstacle, header, "obstacle_" + std::to_string(number++), directory);
  return load_scene(tree, header.scene_file);
}

/// Unpacks each profile of the chain into a directory of its own, because two profiles may have the same
/// name.
DeviceProfile profile_of(const RecordingHeader& header, const fs::path& directory) {
  std::vector<fs::path> places;
  const auto put = [&](const fs::path& at, const std::string& text) {
    places.push_back(directory / ("chain_" + std::to_string(places.size())));
    const fs::path file = places.back() / "profiles" / at.filename();
    write(file, text);
    return file;
  };
  const fs::path nearest = put(header.profile_file, header.profile);
  for (int i = 1;; ++i) {
    const RecordedFile* const parent = find(header, "profile_" + std::to_string(i));
    if (parent == nullptr) break;
    put(parent->path, parent->bytes);
  }
  // A damaged or hostile recording must not name other files of the reader.
  return load_profile(nearest, SearchPath(places), nullptr, FileScope::beneath({directory}));
}

}  // namespace

RecordingHeader recorded_texts(const RunConfig& config) {
  RecordingHeader header;
  header.version = kVersion;
  header.settings_file = config.settings.file;
  header.scene_file = config.scene.file;
  header.profile_file = config.settings.device.profile_file;
  header.settings = config.texts.of(header.settings_file);
  header.scene = config.texts.of(header.scene_file);
  header.profile = config.texts.of(header.profile_file);
  const std::vector<fs::path>& chain = config.texts.profile_chain;
  for (std::size_t i = 1; i < chain.size(); ++i)
    header.files.push_back({"profile_" + std::to_string(i), chain[i], {}, true, config.texts.of(chain[i])});
  const fs::path& script = config.settings.simulation.hand_script;
  header.files.push_back({"hand_script", script, {}, true, config.texts.of(script)});
  header.realtime = word(config.settings.servo.realtime);
  utsname system{};
  if (uname(&system) == 0) header.kernel = std::string(system.sysname) + " " + system.release;
  return header;
}

void add_meshes(const SceneSettings& scene,
                const std::map<fs::path, std::shared_ptr<const MeshBytes>>& loaded, RecordingHeader& header) {
  std::size_t inside = 0;
  const auto add = [&](const std::string& role, const fs::path& at) {
    const auto found = loaded.find(at);
    if (found == loaded.end()) return;
    const MeshBytes& source = *found->second;
    RecordedFile mesh{role, fs::absolute(at).lexically_normal(), source.sha256, true, {}};
    mesh.embedded =
        source.bytes.size() == source.size_bytes && inside + source.bytes.size() <= kMaxEmbeddedMesh_bytes;
    if (mesh.embedded) {
      inside += source.bytes.size();
      mesh.bytes = source.bytes;
    }
    header.files.push_back(std::move(mesh));
  };
  if (!scene.tool.generated) add("tool", scene.tool.mesh);
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    if (!scene.meshes[i].generated) add("obstacle_" + std::to_string(i), scene.meshes[i].mesh);
}

void set_start_time(const Clock& clock, RecordingHeader& header) {
  header.started_ns = clock.now().time_since_epoch().count();
  header.started_unix_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                               std::chrono::system_clock::now().time_since_epoch())
                               .count();
  header.virtual_time = dynamic_cast<const WallClock*>(&clock) == nullptr;
}

RunConfig unpack_run_config(const RecordingHeader& header, const fs::path& directory) {
  if (header.settings.empty() || header.scene.empty() || header.profile.empty())
    throw RecordingError(
        "the recording lacks the texts of its configuration, scene or profile; name them with --config, "
        "--scene and --profile");
  const RecordedFile* const script = find(header, "hand_script");
  const fs::path hand = directory / "hand.toml";
  write(hand, script == nullptr ? "" : script->bytes);
  RunConfig config;
  config.profile = profile_of(header, directory);
  config.scene = scene_of(header, directory);
  TomlNode tree = read_toml_text(header.settings, header.settings_file);
  write(directory / "scene.toml", header.scene);
  set(&tree, "scene", (directory / "scene.toml").string());
  set(table_in(tree, "device"), "profile",
      (directory / "chain_0" / "profiles" / header.profile_file.filename()).string());
  TomlNode* const simulation = table_in(tree, "simulation");
  set(simulation, "hand_script", hand.string());
  set(simulation, "playback", "");
  set(table_in(tree, "servo"), "realtime", header.realtime.empty() ? "required" : header.realtime);
  config.settings = load_settings(tree, header.settings_file, SearchPath({directory}));
  config.simulated = config.profile.transport == Transport::loopback;
  return config;
}

}  // namespace wrenchd
