// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/scene_methods.hpp"

#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include <spdlog/spdlog.h>

#include "collision/meshes/mesh_file.hpp"
#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "daemon/control/scene_geometry.hpp"
#include "daemon/control/vector_param.hpp"

namespace wrenchd {
namespace {

double number_or(const Json& params, const char* name, double otherwise) {
  const auto found = params.find(name);
  return found == params.end() ? otherwise : found->get<double>();
}

/// Returns true if the caller may name files outside of the directories for clients, and read in errors what
/// files contain.
bool may_read_files(const Caller& caller) {
  return caller.role >= Role::administrator;
}

FileScope scope_of(const Caller& caller, const Reconfigurator& reconfigurator) {
  return may_read_files(caller) ? FileScope() : reconfigurator.client_scope();
}

/// Calls the function, and turns the errors of the reconfigurator into RpcError. source: name of the request
/// in errors about its parameters. Errors about files quote them only to callers who may configure.
template <class Call>
MethodResult with_rpc_errors(const Caller& caller, const char* source, const Call& call) {
  try {
    return call();
  } catch (const BusyError& error) {
    throw RpcError(RpcCode::invalid_state, error.what());
  } catch (const ConfigError& error) {
    throw RpcError(RpcCode::rejected, may_read_files(caller) ? error.what() : error.public_text(source));
  } catch (const MeshError& error) {
    throw RpcError(RpcCode::rejected, may_read_files(caller) ? error.what() : error.public_text());
  } catch (const std::invalid_argument& error) {
    throw RpcError(RpcCode::rejected, error.what());
  }
}

/// Returns the scene file of this name: of the candidates along the search path the first in the scope.
std::filesystem::path scene_file(const std::string& name, const FileScope& scope) {
  const SearchPath search;
  if (!scope.restricted()) return search.require(name);
  std::vector<std::filesystem::path> places = search.candidates(name);
  std::erase_if(places, [&scope](const std::filesystem::path& place) { return !scope.contains(place); });
  std::error_code ignored;
  for (const std::filesystem::path& place : places)
    if (std::filesystem::exists(std::filesystem::symlink_status(place, ignored))) return place;
  if (!places.empty()) throw ConfigError(name, {}, search.searched(name));
  throw ConfigError(
      name, {},
      "lies outside of the directories from which clients may load files (" + scope.directories_text() +
          "); store the scene there, or let an administrator name it in wrenchd.toml and reload");
}

Json current_rendering(const Reconfigurator& reconfigurator) {
  return {{"rendering_id", reconfigurator.current_rendering().id}};
}

/// Keeps the geometry memory of the scene while its meshes stay the same.
class GeometryCache {
 public:
  MethodResult result(Reconfigurator& reconfigurator) {
    const Reconfigurator::SceneView view = reconfigurator.scene_view();
    if (!geometry_ || !geometry_->matches(*view.scene)) {
      geometry_ = std::make_unique<SceneGeometry>(view.scene);
      ++geometry_id_;
    }
    Json result = geometry_->description(*view.scene);
    result["geometry_id"] = geometry_id_;
    result["rendering_id"] = view.rendering_id;
    result["scene_time_begins_ns"] = view.scene_time_begins.time_since_epoch().count();
    result["X_WB"] = pose_json(view.X_WB);
    result["X_HT"] = pose_json(view.X_HT);
    result["wrench_about"] = view.wrench_point == WrenchPoint::handle ? "handle" : "world origin";
    result["view"] = view_json(view.viewpoint);
    return {std::move(result), geometry_->descriptor()};
  }

 private:
  std::unique_ptr<SceneGeometry> geometry_;
  std::uint64_t geometry_id_ = 0;
};

Json value_json(const RenderingValue::Value& value) {
  if (const auto* number = std::get_if<double>(&value)) return *number;
  if (const auto* word = std::get_if<std::string>(&value)) return *word;
  Json rows = Json::array();
  for (const auto& row : std::get<Matrix6d>(value).rowwise())
    rows.push_back(std::vector<double>(row.begin(), row.end()));
  return rows;
}

Json rendering_json(const Reconfigurator& reconfigurator) {
  const Settings settings = reconfigurator.settings();
  Json values = Json::array();
  for (const RenderingValue& value : rendering_values()) {
    Json row = {{"name", value.name},
                {"value", value_json(value.read(settings))},
                {"unit", value.unit()},
                {"expected", expected_text(value)}};
    if (const std::vector<std::string> words = accepted_words(value); !words.empty()) row["words"] = words;
    if (const std::string reason = value.unused_reason(settings); !reason.empty()) row["unused"] = reason;
    values.push_back(std::move(row));
  }
  return {{"settings", values}, {"rendering_id", reconfigurator.current_rendering().id}};
}

Json changed_json(const std::vector<ChangedValue>& changed) {
  Json values = Json::array();
  for (const ChangedValue& one : changed)
    values.push_back({{"name", one.value->name},
                      {"unit", one.value->unit()},
                      {"before", value_json(one.before)},
                      {"now", value_json(one.now)}});
  return values;
}

Json scene_json(Reconfigurator& reconfigurator) {
  const auto present = reconfigurator.present_scene();
  const SceneSettings& scene = present->settings;
  const auto kind = [](BodyKind one) { return one == BodyKind::solid ? "solid" : "surface"; };
  Json obstacles = Json::array();
  for (const HalfSpaceSettings& obstacle : scene.half_spaces)
    obstacles.push_back(
        {{"name", obstacle.name},
         {"half_space", {{"normal", json_of(obstacle.normal_W)}, {"offset", obstacle.offset_m}}}});
  for (const MeshObstacleSettings& obstacle : scene.meshes) {
    const Pose X_WM = reconfigurator.present_pose(obstacle);
    obstacles.push_back({{"name", obstacle.name},
                         {"mesh", obstacle.mesh.string()},
                         {"kind", kind(obstacle.kind)},
                         {"scale", obstacle.scale},
                         {"position_m", json_of(X_WM.translation_m)},
                         {"rotation_vector_rad", json_of(rotation_vector(X_WM.rotation))},
                         {"moves", obstacle.motion.moves() || obstacle.scheduled.has_value()}});
  }
  Json bodies = Json::array();
  for (const BodySettings& body : scene.bodies)
    bodies.push_back({{"name", body.name},
                      {"mesh", body.shape.mesh.string()},
                      {"kind", kind(body.shape.kind)},
                      {"scale", body.shape.scale},
                      {"friction", body.friction},
                      {"restitution", body.restitution}});
  return {{"file", scene.file.string()},
          {"tool",
           {{"mesh", scene.tool.mesh.string()},
            {"kind", kind(scene.tool.kind)},
            {"scale", scene.tool.scale},
            {"mass", scene.tool.mass_kg}}},
          {"obstacles", obstacles},
          {"bodies", bodies},
          {"rendering_id", present->rendering_id}};
}

std::uint32_t id_of(const Json& params) {
  const auto id = params["id"].get<std::int64_t>();
  if (id < 0 || id > std::numeric_limits<std::uint32_t>::max())
    throw RpcError(RpcCode::invalid_params, "'id' must be 0 to 4294967295.");
  return static_cast<std::uint32_t>(id);
}

LocalModel model_of(const Json& params) {
  LocalModel model;
  model.id = id_of(params);
  const auto kind = params["kind"].get<std::string>();
  if (kind == "plane") {
    model.kind = LocalModel::Kind::plane;
    if (!params.contains("normal") || !params.contains("offset_m"))
      throw RpcError(RpcCode::invalid_params,
                     "A plane needs 'normal' and 'offset_m': it is solid where normal . x < offset_m.");
  } else if (kind == "spring") {
    model.kind = LocalModel::Kind::spring;
    if (!params.contains("position_m"))
      throw RpcError(RpcCode::invalid_params,
                     "A spring needs 'position_m', its equilibrium position in the world.");
  } else if (kind != "damping") {
    throw RpcError(RpcCode::invalid_params,
                   "There is no kind '" + kind + "' of local models; there are plane, spring, damping.");
  }
  model.normal_W = vector_of(params, "normal", Vector3d::UnitZ());
  model.offset_m = number_or(params, "offset_m", 0.0);
  model.X_WA = {rotation_from(vector_of(params, "rotation_vector_rad", Vector3d::Zero())),
                vector_of(params, "position_m", Vector3d::Zero())};
  model.stiffness_N_per_m = number_or(params, "stiffness_N_per_m", 0.0);
  model.stiffness_Nm_per_rad = number_or(params, "stiffness_Nm_per_rad", 0.0);
  model.damping_N_s_per_m = number_or(params, "damping_N_s_per_m", 0.0);
  model.damping_Nm_s_per_rad = number_or(params, "damping_Nm_s_per_rad", 0.0);
  return model;
}

Json workspace_json(const Reconfigurator& reconfigurator) {
  const WorkspaceRequest request = reconfigurator.workspace();
  return {{"scale", request.scale}, {"clutched", request.clutched}};
}

/// Returns the message of an error without the content of files.
std::string public_text(const std::exception& error) {
  if (const auto* config = dynamic_cast<const ConfigError*>(&error)) return config->public_text({});
  if (const auto* mesh = dynamic_cast<const MeshError*>(&error)) return mesh->public_text();
  return error.what();
}

std::string listed(const std::vector<std::string>& keys) {
  std::string text;
  for (const std::string& key : keys) text += (text.empty() ? "" : ", ") + key;
  return text.empty() ? "nothing" : text;
}

MethodResult reload_result(const Caller& caller, const std::function<ReloadResult()>& reload_all) {
  return with_rpc_errors(caller, "reload", [&] {
    const ReloadResult result = reload_all();
    return MethodResult(Json{{"applied", result.applied},
                             {"not_applied", result.not_applied},
                             {"mesh_warnings", result.mesh_warnings}});
  });
}

}  // namespace

TomlNode toml_of(const Json& json) {
  TomlNode node;
  if (json.is_boolean()) {
    node.value = json.get<bool>();
  } else if (json.is_number_integer()) {
    node.value = json.get<std::int64_t>();
  } else if (json.is_number()) {
    node.value = json.get<double>();
  } else if (json.is_string()) {
    node.value = json.get<std::string>();
  } else if (json.is_array()) {
    TomlNode::Array array;
    for (const Json& element : json) array.push_back(toml_of(element));
    node.value = std::move(array);
  } else if (json.is_object()) {
    TomlNode::Table table;
    for (const auto& [key, value] : json.items()) {
      TomlEntry entry;  // separate steps: gcc warns of an uninitialized value if one statement does all
      entry.key = key;
      entry.node = toml_of(value);
      table.push_back(std::move(entry));
    }
    node.value = std::move(table);
  } else {
    throw RpcError(RpcCode::invalid_params, "A configuration has no null; leave the key out instead.");
  }
  return node;
}

ReloadResult reload_config(Reconfigurator& reconfigurator, EventFeed& feed,
                           const std::function<RunConfig()>& read) try {
  ReloadResult result = reconfigurator.reload(read);
  feed.emit("reload", result.not_applied.empty() ? EventLevel::info : EventLevel::warning,
            "reload: applied: " + listed(result.applied) + "; not applied: " + listed(result.not_applied),
            {{"applied", result.applied}, {"not_applied", result.not_applied}, {"error", nullptr}});
  return result;
} catch (const std::exception& error) {
  // Every observer receives the event, so it quotes no file; the log does.
  const std::string text = public_text(error);
  feed.emit("reload", EventLevel::error, "reload: rejected, nothing changes: " + text,
            {{"applied", Json::array()}, {"not_applied", Json::array()}, {"error", text}});
  if (text != error.what()) spdlog::error("reload: rejected, because: {}", error.what());
  throw;
}

namespace {

void add_scene_queries(MethodTable& table, Reconfigurator& reconfigurator) {
  table.add(MethodRow{
      "scene.get",
      Role::observer,
      {},
      "Returns the tool and the obstacles, each with its name and its present pose.",
      [&reconfigurator](const Json&, const Caller&) { return MethodResult(scene_json(reconfigurator)); },
      true});
  table.add(MethodRow{
      "scene.geometry",
      Role::observer,
      {},
      "Returns where the bodies stand and how they move by scene time, which begins at scene_time_begins_ns. "
      "The reply carries the descriptor of a sealed memory with the triangles (SCM_RIGHTS); the result "
      "states "
      "their offsets. The memory stays the same while 'geometry_id' stays the same.",
      [&reconfigurator, cache = std::make_shared<GeometryCache>()](const Json&, const Caller&) {
        return cache->result(reconfigurator);
      },
      true});
}

void add_scene_changes(MethodTable& table, Reconfigurator& reconfigurator) {
  table.add(MethodRow{
      "scene.load",
      Role::operator_,
      {{"file", ParamType::text, true, "a scene file; a plain name is found along the search path"}},
      "Replaces the scene, tool included. The force crosses over without a step when the proxy has a "
      "feasible "
      "pose in the new scene.",
      [&reconfigurator](const Json& params, const Caller& caller) {
        return with_rpc_errors(caller, "scene.load", [&] {
          const FileScope scope = scope_of(caller, reconfigurator);
          reconfigurator.replace_scene(scene_file(params["file"].get<std::string>(), scope), scope);
          return MethodResult(current_rendering(reconfigurator));
        });
      },
      true});
  table.add(MethodRow{"scene.add",
                      Role::operator_,
                      {{"obstacle", ParamType::object, true, "the keys of an [[obstacle]] of a scene file"}},
                      "Adds an obstacle. Returns its name, which scene.move and scene.remove use.",
                      [&reconfigurator](const Json& params, const Caller& caller) {
                        return with_rpc_errors(caller, "scene.add", [&] {
                          const std::string name = reconfigurator.insert_obstacle(
                              toml_of(params["obstacle"]), "scene.add", scope_of(caller, reconfigurator));
                          Json result = current_rendering(reconfigurator);
                          result["name"] = name;
                          return MethodResult(result);
                        });
                      },
                      true});
  table.add(MethodRow{"scene.remove",
                      Role::operator_,
                      {{"name", ParamType::text, true, "name of the obstacle"}},
                      "Removes an obstacle; its contact force fades out.",
                      [&reconfigurator](const Json& params, const Caller& caller) {
                        return with_rpc_errors(caller, "scene.remove", [&] {
                          reconfigurator.remove_obstacle(params["name"].get<std::string>());
                          return MethodResult(current_rendering(reconfigurator));
                        });
                      },
                      true});
  table.add(MethodRow{
      "scene.move",
      Role::operator_,
      {{"name", ParamType::text, true, "name of the obstacle, which must be a mesh"},
       {"position_m", ParamType::vector, true, "target position of its mesh frame in the world"},
       {"rotation_vector_rad", ParamType::vector, false, "target rotation in the world; default: none"},
       {"duration_s", ParamType::number, true, "duration of the motion, which has constant speed"}},
      "Moves an obstacle to a pose. The motion starts 0.2 s from now and pushes the proxy.",
      [&reconfigurator](const Json& params, const Caller& caller) {
        return with_rpc_errors(caller, "scene.move", [&] {
          const Pose X_WO = {rotation_from(vector_of(params, "rotation_vector_rad", Vector3d::Zero())),
                             vector_of(params, "position_m", Vector3d::Zero())};
          reconfigurator.move_obstacle(params["name"].get<std::string>(), X_WO,
                                       params["duration_s"].get<double>());
          return MethodResult(current_rendering(reconfigurator));
        });
      },
      true});
}

void add_rendering_methods(MethodTable& table, Reconfigurator& reconfigurator) {
  table.add(MethodRow{
      "rendering.get",
      Role::observer,
      {},
      "Returns the values that rendering.set changes, each with its unit and what it accepts; 'unused' "
      "states "
      "why the present law or method does not use a value.",
      [&reconfigurator](const Json&, const Caller&) { return MethodResult(rendering_json(reconfigurator)); },
      true});
  table.add(MethodRow{
      "rendering.set",
      Role::operator_,
      {{"rendering", ParamType::object, false, "keys of [rendering] in wrenchd.toml: method, contacts, ..."},
       {"wrench", ParamType::object, false, "keys of [wrench]: law, stiffness, damping, ..."}},
      "Changes the contact method and the wrench law. Other keys keep their values. Returns in 'changed' "
      "what "
      "held before and what holds now.",
      [&reconfigurator](const Json& params, const Caller& caller) {
        return with_rpc_errors(caller, "rendering.set", [&] {
          const auto changed = reconfigurator.set_rendering(toml_of(params), "rendering.set");
          Json result = current_rendering(reconfigurator);
          result["changed"] = changed_json(changed);
          return MethodResult(result);
        });
      },
      true});
}

void add_workspace_methods(MethodTable& table, Reconfigurator& reconfigurator) {
  table.add(MethodRow{
      "workspace.get",
      Role::observer,
      {},
      "Returns how the handle moves the tool: scale and clutched.",
      [&reconfigurator](const Json&, const Caller&) { return MethodResult(workspace_json(reconfigurator)); },
      true});
  table.add(
      MethodRow{"workspace.set",
                Role::operator_,
                {{"scale", ParamType::number, false,
                  "displacement of the tool divided by displacement of the handle, 0.1 to 10"},
                 {"clutched", ParamType::boolean, false,
                  "true: the tool stays in place without contact force while the handle moves"},
                 {"recentre", ParamType::boolean, false, "true: the tool moves to the pose of the handle"}},
                "Changes how the handle moves the tool, without a step. Returns the new values.",
                [&reconfigurator](const Json& params, const Caller& caller) {
                  return with_rpc_errors(caller, "workspace.set", [&] {
                    if (params.contains("scale")) reconfigurator.set_scale(params["scale"].get<double>());
                    if (params.contains("clutched"))
                      reconfigurator.set_clutched(params["clutched"].get<bool>());
                    if (params.value("recentre", false)) reconfigurator.recentre();
                    return MethodResult(workspace_json(reconfigurator));
                  });
                },
                true});
}

void add_model_methods(MethodTable& table, Reconfigurator& reconfigurator) {
  table.add(MethodRow{
      "model.set",
      Role::operator_,
      {{"id", ParamType::integer, true, "replaces the model that has the same id"},
       {"kind", ParamType::text, true, "plane, spring or damping; acts on the handle point"},
       {"lifetime_s", ParamType::number, true, "the model fades out after this time; at most 10"},
       {"normal", ParamType::vector, false, "plane: normal out of the solid"},
       {"offset_m", ParamType::number, false, "plane: solid where normal . x < offset_m"},
       {"position_m", ParamType::vector, false, "spring: equilibrium position in the world"},
       {"rotation_vector_rad", ParamType::vector, false, "spring: rest rotation in the world"},
       {"stiffness_N_per_m", ParamType::number, false, "plane or spring"},
       {"stiffness_Nm_per_rad", ParamType::number, false, "spring"},
       {"damping_N_s_per_m", ParamType::number, false, "every kind"},
       {"damping_Nm_s_per_rad", ParamType::number, false, "spring or damping"}},
      "Sets a local model of the surroundings of the handle, which the loop renders at its own rate. "
      "Send the model again before its lifetime ends.",
      [&reconfigurator](const Json& params, const Caller& caller) {
        return with_rpc_errors(caller, "model.set", [&] {
          reconfigurator.set_model(model_of(params), params["lifetime_s"].get<double>());
          return MethodResult(Json::object());
        });
      },
      true});
  table.add(MethodRow{"model.remove",
                      Role::operator_,
                      {{"id", ParamType::integer, true, "id of the model"}},
                      "Removes a local model; its force fades out now.",
                      [&reconfigurator](const Json& params, const Caller&) {
                        reconfigurator.remove_model(id_of(params));
                        return MethodResult(Json::object());
                      },
                      true});
}

void add_reload_method(MethodTable& table, std::function<ReloadResult()> reload_all) {
  table.add(MethodRow{
      "reload",
      Role::administrator,
      {},
      "Reads the configuration again, and applies all of it, or nothing if it has an error. Returns the keys "
      "that were applied, and the keys that were not, with the reason.",
      [reload_all = std::move(reload_all)](const Json&, const Caller& caller) {
        return reload_result(caller, reload_all);
      },
      true});
}

}  // namespace

void add_scene_methods(MethodTable& table, Reconfigurator& reconfigurator,
                       std::function<ReloadResult()> reload_all) {
  add_scene_queries(table, reconfigurator);
  add_scene_changes(table, reconfigurator);
  add_rendering_methods(table, reconfigurator);
  add_workspace_methods(table, reconfigurator);
  add_model_methods(table, reconfigurator);
  add_reload_method(table, std::move(reload_all));
}

}  // namespace wrenchd
