// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/scene_methods.hpp"

#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "collision/meshes/mesh_file.hpp"
#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "daemon/control/scene_geometry.hpp"

namespace wrenchd {
namespace {

Vector3d vector_of(const Json& params, const char* name, const Vector3d& otherwise) {
  const auto found = params.find(name);
  if (found == params.end()) return otherwise;
  return {(*found)[0].get<double>(), (*found)[1].get<double>(), (*found)[2].get<double>()};
}

double parse_number(const Json& params, const char* name, double otherwise) {
  const auto found = params.find(name);
  return found == params.end() ? otherwise : found->get<double>();
}

Json json_of(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

/// What the workbench refuses, in the words of the protocol.
template <class Act>
MethodResult answered(const Act& act) {
  try {
    return act();
  } catch (const BusyError& error) {
    throw RpcError(RpcCode::invalid_state, error.what());
  } catch (const ConfigError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  } catch (const MeshError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  } catch (const std::invalid_argument& error) {
    throw RpcError(RpcCode::rejected, error.what());
  }
}

Json handed_over(const Reconfigurator& workbench) {
  return {{"rendering", workbench.current_rendering().id}};
}

/// What the bodies look like, in memory of its own; the same memory for as long as the meshes are the same.
class ShapesKept {
 public:
  MethodResult answer(Reconfigurator& bench) {
    const Reconfigurator::SceneView shown = bench.scene_view();
    if (!shapes_ || !shapes_->matches(*shown.scene)) {
      shapes_ = std::make_unique<SceneGeometry>(shown.scene);
      ++number_;
    }
    Json result = shapes_->description(*shown.scene);
    result["shapes"] = number_;
    result["rendering"] = shown.rendering_id;
    result["scene_time_begins_ns"] = shown.scene_time_begins.time_since_epoch().count();
    result["X_WB"] = pose_json(shown.X_WB);
    result["X_HT"] = pose_json(shown.X_HT);
    result["wrench_about"] = shown.wrench_point == WrenchPoint::handle ? "handle" : "world origin";
    result["view"] = view_json(shown.viewpoint);
    return {std::move(result), shapes_->descriptor()};
  }

 private:
  std::unique_ptr<SceneGeometry> shapes_;
  std::uint64_t number_ = 0;
};

Json scene_json(const Reconfigurator& workbench) {
  const SceneSettings scene = workbench.scene();
  Json obstacles = Json::array();
  for (const HalfSpaceSettings& obstacle : scene.half_spaces)
    obstacles.push_back(
        {{"name", obstacle.name},
         {"half_space", {{"normal", json_of(obstacle.normal_W)}, {"offset", obstacle.offset_m}}}});
  for (const MeshObstacleSettings& obstacle : scene.meshes)
    obstacles.push_back({{"name", obstacle.name},
                         {"mesh", obstacle.mesh.string()},
                         {"scale", obstacle.scale},
                         {"position_m", json_of(obstacle.X_WM.translation_m)},
                         {"rotation_vector_rad", json_of(rotation_vector(obstacle.X_WM.rotation))},
                         {"moves", obstacle.motion.moves() || obstacle.scheduled.has_value()}});
  return {{"file", scene.file.string()},
          {"tool",
           {{"mesh", scene.tool.mesh.string()}, {"scale", scene.tool.scale}, {"mass", scene.tool.mass_kg}}},
          {"obstacles", obstacles},
          {"rendering", workbench.current_rendering().id}};
}

std::uint32_t id_of(const Json& params) {
  const auto id = params["id"].get<std::int64_t>();
  if (id < 0 || id > std::numeric_limits<std::uint32_t>::max())
    throw RpcError(RpcCode::invalid_params, "'id' is 0 to 4294967295.");
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
                     "A spring needs 'position_m', the place in the world that it draws the handle to.");
  } else if (kind != "damping") {
    throw RpcError(RpcCode::invalid_params,
                   "There is no local model '" + kind + "'; there are plane, spring, damping.");
  }
  model.normal_W = vector_of(params, "normal", Vector3d::UnitZ());
  model.offset_m = parse_number(params, "offset_m", 0.0);
  model.X_WA = {rotation_from(vector_of(params, "rotation_vector_rad", Vector3d::Zero())),
                vector_of(params, "position_m", Vector3d::Zero())};
  model.stiffness_N_per_m = parse_number(params, "stiffness_N_per_m", 0.0);
  model.stiffness_Nm_per_rad = parse_number(params, "stiffness_Nm_per_rad", 0.0);
  model.damping_N_s_per_m = parse_number(params, "damping_N_s_per_m", 0.0);
  model.damping_Nm_s_per_rad = parse_number(params, "damping_Nm_s_per_rad", 0.0);
  return model;
}

Json workspace_json(const Reconfigurator& workbench) {
  const WorkspaceRequest wish = workbench.workspace();
  return {{"scale", wish.scale}, {"clutched", wish.clutched}};
}

std::string listed(const std::vector<std::string>& what) {
  std::string text;
  for (const std::string& one : what) text += (text.empty() ? "" : ", ") + one;
  return text.empty() ? "nothing" : text;
}

MethodResult reloaded(const std::function<ReloadResult()>& reload_all) {
  return answered([&] {
    const ReloadResult result = reload_all();
    return MethodResult(
        Json{{"applied", result.applied}, {"not_applied", result.not_applied}, {"remarks", result.remarks}});
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
      TomlEntry entry;  // not in one: the compiler takes a moved place for one that was never set
      entry.key = key;
      entry.node = toml_of(value);
      table.push_back(std::move(entry));
    }
    node.value = std::move(table);
  } else {
    throw RpcError(RpcCode::invalid_params,
                   "There is no null in a configuration; leave the key out instead.");
  }
  return node;
}

ReloadResult reload_config(Reconfigurator& workbench, EventFeed& feed,
                           const std::function<RunConfig()>& read) try {
  ReloadResult result = workbench.reload(read);
  feed.emit("reload", result.not_applied.empty() ? EventLevel::info : EventLevel::warning,
            "reload: applied: " + listed(result.applied) + "; not applied: " + listed(result.not_applied),
            {{"applied", result.applied}, {"not_applied", result.not_applied}, {"refused", nullptr}});
  return result;
} catch (const std::exception& error) {
  feed.emit("reload", EventLevel::error,
            std::string("reload: refused, and everything stays as it was: ") + error.what(),
            {{"applied", Json::array()}, {"not_applied", Json::array()}, {"refused", error.what()}});
  throw;
}

void add_scene_methods(MethodTable& table, Reconfigurator& workbench,
                       std::function<ReloadResult()> reload_all) {
  Reconfigurator& bench = workbench;
  table.add(MethodRow{"scene.get",
                      Role::observer,
                      {},
                      "The tool and the obstacles, each with its name.",
                      [&bench](const Json&, const Caller&) { return MethodResult(scene_json(bench)); },
                      true});
  table.add(
      MethodRow{"scene.shapes",
                Role::observer,
                {},
                "What the bodies look like: hands over the descriptor of a sealed memory with their "
                "triangles beside the "
                "answer (SCM_RIGHTS), and answers where in it they lie, where the bodies stand and how they "
                "move by scene "
                "time, which begins at scene_time_begins_ns. The memory stays the same while 'shapes' does.",
                [&bench, kept = std::make_shared<ShapesKept>()](const Json&, const Caller&) {
                  return kept->answer(bench);
                },
                true});
  table.add(MethodRow{
      "scene.load",
      Role::operator_,
      {{"file", ParamType::text, true, "a scene file; a plain name is looked for as wrenchd.toml is"}},
      "Another scene, tool included. It is felt when its place is found, without a jump.",
      [&bench](const Json& params, const Caller&) {
        return answered([&] {
          bench.replace_scene(SearchPath().require(params["file"].get<std::string>()));
          return MethodResult(handed_over(bench));
        });
      },
      true});
  table.add(MethodRow{"scene.add",
                      Role::operator_,
                      {{"obstacle", ParamType::object, true, "what an [[obstacle]] of a scene file holds"}},
                      "Another obstacle. Answers its name, by which it is moved and removed.",
                      [&bench](const Json& params, const Caller&) {
                        return answered([&] {
                          const std::string name =
                              bench.insert_obstacle(toml_of(params["obstacle"]), "scene.add");
                          Json result = handed_over(bench);
                          result["name"] = name;
                          return MethodResult(result);
                        });
                      },
                      true});
  table.add(MethodRow{"scene.remove",
                      Role::operator_,
                      {{"name", ParamType::text, true, "of the obstacle"}},
                      "Takes an obstacle away; what it pushed fades.",
                      [&bench](const Json& params, const Caller&) {
                        return answered([&] {
                          bench.remove_obstacle(params["name"].get<std::string>());
                          return MethodResult(handed_over(bench));
                        });
                      },
                      true});
  table.add(MethodRow{
      "scene.move",
      Role::operator_,
      {{"name", ParamType::text, true, "of the obstacle, which has to be a mesh"},
       {"position_m", ParamType::vector, true, "where its mesh frame goes, in the world"},
       {"rotation_vector_rad", ParamType::vector, false, "and how it is turned there; else not at all"},
       {"over_s", ParamType::number, true, "how long it takes, at constant speed"}},
      "Lets an obstacle go to a pose; it sets out 0.2 s from now and pushes what is in its way.",
      [&bench](const Json& params, const Caller&) {
        return answered([&] {
          const Pose X_WO = {rotation_from(vector_of(params, "rotation_vector_rad", Vector3d::Zero())),
                             vector_of(params, "position_m", Vector3d::Zero())};
          bench.move_obstacle(params["name"].get<std::string>(), X_WO, params["over_s"].get<double>());
          return MethodResult(handed_over(bench));
        });
      },
      true});
  table.add(MethodRow{
      "rendering.set",
      Role::operator_,
      {{"rendering", ParamType::object, false, "keys of [rendering] in wrenchd.toml: method, friction, ..."},
       {"wrench", ParamType::object, false, "keys of [wrench]: law, stiffness, damping, ..."}},
      "Changes how contact is computed and how stiff it feels; what is not given stays.",
      [&bench](const Json& params, const Caller&) {
        return answered([&] {
          bench.set_rendering(toml_of(params), "rendering.set");
          return MethodResult(handed_over(bench));
        });
      },
      true});
  table.add(MethodRow{
      "workspace.set",
      Role::operator_,
      {{"scale", ParamType::number, false, "metres that the tool goes for a metre of the handle, 0.1 to 10"},
       {"clutched", ParamType::boolean, false,
        "the tool stands, and no contact is felt, while the handle goes elsewhere"},
       {"recentre", ParamType::boolean, false, "true: the tool comes to where the handle is"}},
      "Changes how the handle moves the tool, without a jump. Answers what holds then.",
      [&bench](const Json& params, const Caller&) {
        return answered([&] {
          if (params.contains("scale")) bench.set_scale(params["scale"].get<double>());
          if (params.contains("clutched")) bench.set_clutched(params["clutched"].get<bool>());
          if (params.value("recentre", false)) bench.recentre();
          return MethodResult(workspace_json(bench));
        });
      },
      true});
  table.add(
      MethodRow{"model.set",
                Role::operator_,
                {{"id", ParamType::integer, true, "one of the same id takes the place of the last"},
                 {"kind", ParamType::text, true, "plane, spring or damping, of the handle point"},
                 {"expires_s", ParamType::number, true, "it fades out by then; at most 10"},
                 {"normal", ParamType::vector, false, "of a plane, out of the solid"},
                 {"offset_m", ParamType::number, false, "of a plane: solid where normal . x < offset_m"},
                 {"position_m", ParamType::vector, false, "where a spring draws the handle to, in the world"},
                 {"rotation_vector_rad", ParamType::vector, false, "and how it turns it"},
                 {"stiffness_N_per_m", ParamType::number, false, "of a plane or a spring"},
                 {"stiffness_Nm_per_rad", ParamType::number, false, "of a spring"},
                 {"damping_N_s_per_m", ParamType::number, false, "of any"},
                 {"damping_Nm_s_per_rad", ParamType::number, false, "of a spring or a damping field"}},
                "What the client knows of the surroundings of the handle, felt at the loop's rate until it "
                "expires. Send it again before that.",
                [&bench](const Json& params, const Caller&) {
                  return answered([&] {
                    bench.set_model(model_of(params), params["expires_s"].get<double>());
                    return MethodResult(Json::object());
                  });
                },
                true});
  table.add(MethodRow{"model.remove",
                      Role::operator_,
                      {{"id", ParamType::integer, true, "of the model"}},
                      "Lets a local model fade out now.",
                      [&bench](const Json& params, const Caller&) {
                        bench.remove_model(id_of(params));
                        return MethodResult(Json::object());
                      },
                      true});
  table.add(MethodRow{
      "reload",
      Role::administrator,
      {},
      "Reads the configuration again, all of it or nothing. Answers what was applied, and what "
      "was not and why.",
      [reload_all = std::move(reload_all)](const Json&, const Caller&) { return reloaded(reload_all); },
      true});
}

}  // namespace wrenchd
