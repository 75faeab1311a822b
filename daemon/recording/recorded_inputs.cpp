// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recorded_inputs.hpp"

#include <chrono>
#include <fstream>
#include <utility>

#include <sys/utsname.h>

#include "config/inherited_toml.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "config/setting_table.hpp"
#include "core/files/opened_file.hpp"
#include "daemon/version.hpp"
#include "daemon/wall_clock.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

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

void write_input(const fs::path& file, const std::string& bytes) {
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
    write_input(file, mesh->bytes);
    return file;
  }
  const auto bytes = read_file_if_readable(mesh->path);
  if (!bytes || sha256_text(*bytes) != mesh->sha256)
    throw RecordingError(mesh->path.string() + ": " +
                         (bytes ? "has changed since it was recorded" : "cannot be read any more") +
                         " (SHA-256 " + mesh->sha256 +
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

TomlNode& add_node(TomlNode::Table& table, const std::string& key) {
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
  if (auto* entries = std::get_if<TomlNode::Table>(&table->value)) add_node(*entries, key).value = value;
}

/// Returns the table `key` of a table, and creates it if it is missing.
TomlNode* table_in(TomlNode& root, const std::string& key) {
  if (TomlEntry* const entry = find(root, key)) return &entry->node;
  auto* entries = std::get_if<TomlNode::Table>(&root.value);
  if (entries == nullptr) return nullptr;
  TomlNode& made = add_node(*entries, key);
  made.value = TomlNode::Table{};
  return &made;
}

/// Returns the role of a part of a body: that of the body for the first part.
std::string part_role(const std::string& body, std::size_t part) {
  return part == 0 ? body : body + "_part_" + std::to_string(part);
}

/// Replaces the mesh paths of a body by the paths of the unpacked files. Leaves a generated mesh unchanged.
void put_mesh(TomlNode& body, const RecordingHeader& header, const std::string& role,
              const fs::path& directory) {
  if (TomlEntry* const parts = find(body, "meshes"))
    if (auto* list = std::get_if<TomlNode::Array>(&parts->node.value))
      for (std::size_t i = 0; i < list->size(); ++i)
        (*list)[i].value = mesh_at(header, part_role(role, i), directory).string();
  TomlEntry* const mesh = find(body, "mesh");
  if (mesh != nullptr && std::holds_alternative<std::string>(mesh->node.value))
    mesh->node.value = mesh_at(header, role, directory).string();
}

/// Returns the table [[hand]] of settings; null if there is none.
TomlNode* second_hand_of(TomlNode& settings) {
  TomlEntry* const found = find(settings, "hand");
  auto* const list = found == nullptr ? nullptr : std::get_if<TomlNode::Array>(&found->node.value);
  return list == nullptr || list->empty() ? nullptr : &list->front();
}

/// Removes [[hand]], and returns its name; empty if there is none. If the ticks are those of the second hand,
/// its sections take the place of those of the first one. The scene and the profile of the recording are
/// those of this hand already.
std::string choose_hand(TomlNode& tree, const RecordingHeader& header) {
  TomlNode* const found = second_hand_of(tree);
  if (found == nullptr) return {};
  TomlNode hand = std::move(*found);
  std::erase_if(std::get<TomlNode::Table>(tree.value),
                [](const TomlEntry& entry) { return entry.key == "hand"; });
  TomlEntry* const name = find(hand, "name");
  const auto* const text = name == nullptr ? nullptr : std::get_if<std::string>(&name->node.value);
  if (text == nullptr) return {};
  if (header.hand.empty()) return *text;
  for (const std::string_view name_of_section : sections_of_hand()) {
    const std::string section(name_of_section);
    TomlEntry* const own = find(hand, section);
    auto* const values = own == nullptr ? nullptr : std::get_if<TomlNode::Table>(&own->node.value);
    auto* const common = std::get_if<TomlNode::Table>(&table_in(tree, section)->value);
    if (values == nullptr || common == nullptr) continue;
    merge_over(*values, std::move(*common));
    *common = std::move(*values);
  }
  return *text;
}

SceneSettings scene_of(const RecordingHeader& header, const fs::path& directory) {
  TomlNode tree = read_toml_text(header.scene, header.scene_file);
  if (TomlEntry* const tool = find(tree, "tool")) put_mesh(tool->node, header, "tool", directory);
  int number = 0;
  if (TomlEntry* const obstacles = find(tree, "obstacle"))
    if (auto* list = std::get_if<TomlNode::Array>(&obstacles->node.value))
      for (TomlNode& obstacle : *list)
        if (find(obstacle, "mesh") != nullptr || find(obstacle, "meshes") != nullptr)
          put_mesh(obstacle, header, "obstacle_" + std::to_string(number++), directory);
  number = 0;
  if (TomlEntry* const bodies = find(tree, "body"))
    if (auto* list = std::get_if<TomlNode::Array>(&bodies->node.value))
      for (TomlNode& body : *list) put_mesh(body, header, "body_" + std::to_string(number++), directory);
  return load_scene(tree, header.scene_file);
}

/// Unpacks each profile of the chain into a directory of its own, because two profiles may have the same
/// name.
DeviceProfile profile_of(const RecordingHeader& header, const fs::path& directory) {
  std::vector<fs::path> places;
  const auto put = [&](const fs::path& at, const std::string& text) {
    places.push_back(directory / ("chain_" + std::to_string(places.size())));
    const fs::path file = places.back() / "profiles" / at.filename();
    write_input(file, text);
    return file;
  };
  const fs::path nearest = put(header.profile_file, header.profile);
  for (int i = 1;; ++i) {
    const RecordedFile* const parent = find(header, "profile_" + std::to_string(i));
    if (parent == nullptr) break;
    put(parent->path, parent->bytes);
  }
  return load_profile(nearest, SearchPath(places));
}

}  // namespace

RecordingHeader read_recorded_texts(const RunConfig& config) {
  RecordingHeader header;
  header.version = kVersion;
  header.settings_file = config.settings.file;
  header.scene_file = config.scene.file;
  header.profile_file = config.settings.device.profile_file;
  header.settings = config.settings.text;
  header.scene = config.scene.text;
  int number = 0;
  for (const ConfigText& one : config.profile_texts) {
    if (number == 0)
      header.profile = one.text;
    else
      header.files.push_back({"profile_" + std::to_string(number), one.file, {}, true, one.text});
    ++number;
  }
  header.files.push_back(
      {"hand_script", config.settings.simulation.hand_script, {}, true, config.settings.hand_script_text});
  header.realtime = word(config.settings.servo.realtime);
  header.hands = config.two_hands() ? 2 : 1;
  header.hand = config.hand();
  utsname system{};
  if (uname(&system) == 0) header.kernel = std::string(system.sysname) + " " + system.release;
  return header;
}

void add_meshes(const SceneSettings& scene, const MeshLoader& loaded, RecordingHeader& header) {
  const auto add_all = [&](const std::string& role, const std::vector<fs::path>& files) {
    for (std::size_t i = 0; i < files.size(); ++i) {
      const MeshInput* const input = loaded.input(files[i]);
      if (input == nullptr) continue;  // polygons of a program
      RecordedFile mesh{part_role(role, i), input->file, input->sha256, input->bytes != nullptr, {}};
      if (input->bytes) mesh.bytes = *input->bytes;
      header.files.push_back(std::move(mesh));
    }
  };
  add_all("tool", mesh_files(scene.tool));
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    add_all("obstacle_" + std::to_string(i), mesh_files(scene.meshes[i]));
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    add_all("body_" + std::to_string(i), mesh_files(scene.bodies[i].shape));
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
  write_input(hand, script == nullptr ? "" : script->bytes);
  RunConfig config;
  config.profile = profile_of(header, directory);
  config.scene = scene_of(header, directory);
  TomlNode tree = read_toml_text(header.settings, header.settings_file);
  config.second_hand = choose_hand(tree, header);
  config.is_second = !header.hand.empty();
  write_input(directory / "scene.toml", header.scene);
  set(&tree, "scene", (directory / "scene.toml").string());
  set(table_in(tree, "device"), "profile",
      (directory / "chain_0" / "profiles" / header.profile_file.filename()).string());
  TomlNode* const simulation = table_in(tree, "simulation");
  set(simulation, "hand_script", hand.string());
  set(simulation, "playback", "");
  set(table_in(tree, "servo"), "realtime", header.realtime.empty() ? "required" : header.realtime);
  config.settings = load_settings(tree, header.settings_file, SearchPath({directory}));
  config.scene.smoothing_m = config.settings.rendering.smoothing_m;
  config.simulated = config.profile.transport == Transport::loopback;
  return config;
}

bool hands_have_same_tool(const RecordingHeader& header) {
  if (header.hands != 2) return false;
  TomlNode tree = read_toml_text(header.settings, header.settings_file);
  TomlNode* const hand = second_hand_of(tree);
  return hand != nullptr && find(*hand, "tool") == nullptr;
}

}  // namespace wrenchd
