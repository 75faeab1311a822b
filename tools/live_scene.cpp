// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/live_scene.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <spdlog/fmt/fmt.h>

#include "config/near_file.hpp"
#include "config/nearest_key.hpp"
#include "config/search_path.hpp"
#include "config/toml_file.hpp"
#include "core/files/absolute_name.hpp"
#include "core/generated_mesh.hpp"
#include "tools/daemon_call.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHalfSpace = "half_space";

/// Three numbers that read back as the same values, for a command.
std::string exact_text(const Json& vector) {
  std::string text;
  for (const Json& number : vector) text += (text.empty() ? "" : " ") + to_text(number.get<double>());
  return text;
}

/// Three numbers with six digits, for a reader.
std::string vector_text(const Json& vector) {
  std::string text;
  for (const Json& number : vector)
    text += fmt::format("{}{:.6g}", text.empty() ? "" : " ", number.get<double>());
  return text;
}

std::vector<double> rotation_of(const SceneEdit& edit) {
  if (edit.rotation_deg.empty()) return vector_of(edit.rotation_rad, "--rotation");
  std::vector<double> rotation = vector_of(edit.rotation_deg, "--rotation-deg");
  for (double& component : rotation) component *= std::numbers::pi / 180.0;
  return rotation;
}

bool has_rotation(const SceneEdit& edit) {
  return !edit.rotation_rad.empty() || !edit.rotation_deg.empty();
}

bool is_kind_of_mesh(const std::string& name) {
  const auto& kinds = mesh_kinds();
  return std::any_of(kinds.begin(), kinds.end(), [&](const MeshKind& kind) { return kind.name == name; });
}

/// Returns the path of a file in the working directory or on the search path.
std::string mesh_file(const std::string& name) {
  std::error_code ignored;
  if (fs::exists(name, ignored)) return absolute_name(name).string();
  const SearchPath search;
  if (const auto found = search.find(name)) return found->string();
  std::vector<std::string> kinds = {kHalfSpace};
  for (const MeshKind& kind : mesh_kinds()) kinds.push_back(kind.name);
  std::string all;
  for (const std::string& kind : kinds) all += (all.empty() ? "" : ", ") + kind;
  const bool may_be_kind = !fs::path(name).has_parent_path() && !fs::path(name).has_extension();
  std::string advice = may_be_kind ? nearest_name_advice(name, kinds) : "";
  if (const fs::path near = near_file(name); advice.empty() && !near.empty())
    advice = "; did you mean '" + near.string() + "'?";
  throw std::runtime_error("scene add: '" + name + "' is neither a file nor a kind of obstacle" +
                           (advice.empty() ? "; name a mesh file, or one of " + all : advice));
}

void reject_for(bool given, const std::string& option, const std::string& subject) {
  if (given) throw std::runtime_error("scene add " + subject + ": accepts no " + option);
}

Json half_space_request(const SceneEdit& edit) {
  for (const auto& [given, option] :
       {std::pair{!edit.position_m.empty(), "--position"}, std::pair{has_rotation(edit), "--rotation"},
        std::pair{edit.scale.has_value(), "--scale"}, std::pair{!edit.kind.empty(), "--kind"},
        std::pair{edit.triangles.has_value(), "--triangles"}})
    reject_for(given, std::string(option) + "; --normal and --offset define it", kHalfSpace);
  if (edit.normal.empty() || !edit.offset_m)
    throw std::runtime_error(
        "scene add half_space: --normal and --offset are missing: it is solid where normal . x < offset, as "
        "in "
        "--normal 0 0 1 --offset -0.1");
  return {{"half_space", {{"normal", vector_of(edit.normal, "--normal")}, {"offset", *edit.offset_m}}}};
}

Json mesh_request(const SceneEdit& edit) {
  reject_for(!edit.normal.empty(), "--normal; only half_space does", edit.subject);
  reject_for(edit.offset_m.has_value(), "--offset; only half_space does", edit.subject);
  std::error_code ignored;
  Json obstacle = Json::object();
  if (is_kind_of_mesh(edit.subject) && !fs::exists(edit.subject, ignored)) {
    Json& mesh = obstacle["mesh"] = {{"make", edit.subject}};
    if (edit.triangles) mesh["triangles"] = *edit.triangles;
    if (edit.seed) mesh["seed"] = *edit.seed;
    if (!edit.size_m.empty()) mesh["size_m"] = vector_of(edit.size_m, "--size");
  } else {
    obstacle["mesh"] = mesh_file(edit.subject);
    reject_for(edit.triangles.has_value(), "--triangles; only a generated mesh does", edit.subject);
    reject_for(edit.seed.has_value(), "--seed; only a generated mesh does", edit.subject);
    reject_for(!edit.size_m.empty(), "--size; only a generated box does", edit.subject);
  }
  if (edit.scale) obstacle["scale"] = *edit.scale;
  if (!edit.kind.empty()) obstacle["kind"] = edit.kind;
  if (!edit.position_m.empty()) obstacle["position_m"] = vector_of(edit.position_m, "--position");
  if (has_rotation(edit)) obstacle["rotation_vector_rad"] = rotation_of(edit);
  return obstacle;
}

/// Returns the obstacle of this name, or throws with the nearest name.
Json find_obstacle(const Json& scene, const std::string& name) {
  std::vector<std::string> known;
  std::string names;
  for (const Json& obstacle : scene["obstacles"]) {
    if (obstacle["name"] == name) return obstacle;
    known.push_back(obstacle["name"]);
    names += (names.empty() ? "" : ", ") + known.back();
  }
  const std::string advice = nearest_name_advice(name, known);
  throw std::runtime_error("there is no obstacle '" + name + "' in the scene" +
                           (advice.empty() ? "; there are: " + (names.empty() ? "none" : names) : advice));
}

std::string shell_word(const std::string& word) {
  return word.find_first_of(" []'\"$&;()") == std::string::npos ? word : "'" + word + "'";
}

std::string pose_options(const Json& obstacle) {
  return " --position " + exact_text(obstacle["position_m"]) + " --rotation " +
         exact_text(obstacle["rotation_vector_rad"]);
}

/// Returns the command that adds a removed obstacle again; empty: no command does.
std::string command_to_add(const Json& obstacle) {
  const std::string name = " --name " + shell_word(obstacle["name"]);
  if (const auto plane = obstacle.find("half_space"); plane != obstacle.end())
    return "wrenchctl scene add half_space" + name + " --normal " + exact_text((*plane)["normal"]) +
           " --offset " + to_text((*plane)["offset"].get<double>());
  const auto mesh = obstacle["mesh"].get<std::string>();
  std::error_code ignored;
  if (!fs::is_regular_file(mesh, ignored) || obstacle["moves"] == true) return {};
  return "wrenchctl scene add " + shell_word(mesh) + name + " --kind " + obstacle["kind"].get<std::string>() +
         " --scale " + to_text(obstacle["scale"].get<double>()) + pose_options(obstacle);
}

void load(Client& client, const std::string& file, const ControlOptions& options) {
  const Json before = call(client, "scene.get");
  const Json result = call(client, "scene.load", {{"file", file}});
  if (options.json) return print(pretty(result));
  const Json now = call(client, "scene.get");
  print(fmt::format("scene: {} -> {}, {} obstacles\n", before["file"].get<std::string>(),
                    now["file"].get<std::string>(), now["obstacles"].size()));
  if (before["file"] != now["file"]) print("undo: wrenchctl scene load " + shell_word(before["file"]) + "\n");
}

/// A file in the working directory, else a name that the daemon searches; "peg" is scenes/peg.toml there.
std::string scene_name(const std::string& name) {
  std::error_code ignored;
  if (fs::exists(name, ignored)) return absolute_name(name).string();
  const fs::path path(name);
  return path.has_parent_path() || path.has_extension() ? name : "scenes/" + name + ".toml";
}

}  // namespace

std::vector<double> vector_of(const std::vector<std::string>& words, const std::string& option) {
  std::vector<double> numbers;
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : ",") + word;
  bool good = !all.empty();
  for (std::size_t begin = 0; good && begin <= all.size();) {
    const std::size_t end = std::min(all.find(',', begin), all.size());
    double number = 0.0;
    const auto parsed = std::from_chars(all.data() + begin, all.data() + end, number);
    good = parsed.ec == std::errc() && parsed.ptr == all.data() + end && std::isfinite(number);
    numbers.push_back(number);
    begin = end + 1;
  }
  if (!good || numbers.size() != 3)
    throw std::runtime_error(option + ": expected three numbers, as in " + option + " 0 0.1 0, found '" +
                             all + "'");
  return numbers;
}

Json obstacle_request(const SceneEdit& edit) {
  Json obstacle = edit.subject == kHalfSpace ? half_space_request(edit) : mesh_request(edit);
  if (!edit.name.empty()) obstacle["name"] = edit.name;
  return obstacle;
}

std::string scene_list_text(const Json& scene) {
  std::size_t width = std::string("scene").size();
  for (const Json& obstacle : scene["obstacles"])
    width = std::max(width, obstacle["name"].get<std::string>().size());
  const Json& tool = scene["tool"];
  std::string text = fmt::format(
      "{:<{}}  {}\n{:<{}}  {}, {}, {:g} kg\n", "scene", width, scene["file"].get<std::string>(), "tool",
      width, tool["mesh"].get<std::string>(), tool["kind"].get<std::string>(), tool["mass"].get<double>());
  for (const Json& obstacle : scene["obstacles"]) {
    text += fmt::format("{:<{}}  ", obstacle["name"].get<std::string>(), width);
    if (const auto plane = obstacle.find("half_space"); plane != obstacle.end())
      text += fmt::format("half_space, normal {}, offset {:g} m\n", vector_text((*plane)["normal"]),
                          (*plane)["offset"].get<double>());
    else
      text += fmt::format("{}, {}, position {} m, rotation {} rad{}\n", obstacle["mesh"].get<std::string>(),
                          obstacle["kind"].get<std::string>(), vector_text(obstacle["position_m"]),
                          vector_text(obstacle["rotation_vector_rad"]),
                          obstacle["moves"] == true ? ", moves" : "");
  }
  return text;
}

void run_scene_list(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json scene = call(client, "scene.get");
  print(options.json ? pretty(scene) : scene_list_text(scene));
}

void run_scene_load(const SceneEdit& edit, const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  load(client, scene_name(edit.subject), options);
}

void run_scene_reset(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  load(client, call(client, "scene.get")["file"], options);
}

void run_scene_add(const SceneEdit& edit, const ControlOptions& options) {
  const Json obstacle = obstacle_request(edit);
  Client client(options.socket, kResponseTimeout);
  const Json result = call(client, "scene.add", {{"obstacle", obstacle}});
  if (options.json) return print(pretty(result));
  const auto name = result["name"].get<std::string>();
  print("added " + name + "\nundo: wrenchctl scene remove " + shell_word(name) + "\n");
}

/// What the user does not state stays as it is: position or rotation.
void run_scene_move(const SceneEdit& edit, const ControlOptions& options) {
  if (edit.position_m.empty() && !has_rotation(edit))
    throw std::runtime_error("scene move " + edit.subject +
                             ": the goal is missing: state --position, --rotation or --rotation-deg");
  Client client(options.socket, kResponseTimeout);
  const Json before = find_obstacle(call(client, "scene.get"), edit.subject);
  if (!before.contains("position_m"))
    throw std::runtime_error("scene move " + edit.subject +
                             ": a half_space cannot move; remove it, and add it in another place");
  Json request = {{"name", edit.subject},
                  {"position_m", before["position_m"]},
                  {"rotation_vector_rad", before["rotation_vector_rad"]},
                  {"duration_s", edit.duration_s}};
  if (!edit.position_m.empty()) request["position_m"] = vector_of(edit.position_m, "--position");
  if (has_rotation(edit)) request["rotation_vector_rad"] = rotation_of(edit);
  const Json result = call(client, "scene.move", request);
  if (options.json) return print(pretty(result));
  print(fmt::format("{}: position {} -> {} m, rotation {} -> {} rad, in {:g} s\n", edit.subject,
                    vector_text(before["position_m"]), vector_text(request["position_m"]),
                    vector_text(before["rotation_vector_rad"]), vector_text(request["rotation_vector_rad"]),
                    edit.duration_s));
  print("undo: wrenchctl scene move " + shell_word(edit.subject) + pose_options(before) + "\n");
}

void run_scene_remove(const SceneEdit& edit, const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json before = find_obstacle(call(client, "scene.get"), edit.subject);
  const Json result = call(client, "scene.remove", {{"name", edit.subject}});
  if (options.json) return print(pretty(result));
  print("removed " + edit.subject + "\n");
  const std::string undo = command_to_add(before);
  print(undo.empty() ? "undo: wrenchctl scene reset, which loads the scene file again\n"
                     : "undo: " + undo + "\n");
}

}  // namespace wrenchd
