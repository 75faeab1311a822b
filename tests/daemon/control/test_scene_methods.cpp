// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <string>

#include <catch2/catch.hpp>

#include "daemon/control/scene_methods.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_scene_methods {

// Clients read and change the rendering: each request is looked up in the method table, with a role and
// parameters in JSON.

namespace {

using namespace test;

struct Rig {
  VirtualRuntime s;
  MethodTable table;
  int reloads = 0;

  explicit Rig(const RunConfig& plan = shipped_config()) : s(plan) {
    add_scene_methods(table, s.runtime.reconfigurator(), [this] {
      ++reloads;
      return ReloadResult{{"limits"}, {"servo.rate_Hz"}, {}};
    });
  }

  Json ask(const std::string& method, const Json& params = Json::object(),
           Role role = Role::administrator) const {
    const RpcRequest request{method, params, 1, true};
    Caller caller;
    caller.role = role;
    return MethodTable::run(table.look_up(request, role), params, caller).result;
  }
  /// Returns the error that the request is answered with.
  RpcError rejected(const std::string& method, const Json& params, Role role = Role::administrator) const {
    try {
      const Json result = ask(method, params, role);
      FAIL(method << " takes " << params.dump() << " and answers " << result.dump());
    } catch (const RpcError& error) {
      return error;
    }
    throw std::logic_error("not reached");
  }
  std::vector<std::string> obstacles() const {
    std::vector<std::string> names;
    const Json scene = ask("scene.get");
    for (const Json& obstacle : scene["obstacles"]) names.push_back(obstacle["name"]);
    return names;
  }
};

void has(const RpcError& error, const std::string& part) {
  INFO(error.what());
  CHECK(std::string(error.what()).find(part) != std::string::npos);
}

Json a_block() {
  return {{"name", "block"},
          {"mesh", test::source_path("config/meshes/cube.off")},
          {"scale", 0.001},
          {"position_m", {0.0, 0.2, 0.0}}};
}

TEST_CASE("obstacles are added, listed, moved and removed by name", "[scene_methods]") {
  const Rig a;
  CHECK(a.obstacles() == std::vector<std::string>{"table"});
  const Json added = a.ask("scene.add", {{"obstacle", a_block()}});
  CHECK(added["name"] == "block");
  CHECK(added["rendering_id"] == 1);
  CHECK(a.obstacles() == std::vector<std::string>{"table", "block"});
  const Json scene = a.ask("scene.get");
  CHECK(scene["obstacles"][0]["half_space"]["normal"] == Json({0.0, 0.0, 1.0}));
  CHECK(scene["obstacles"][1]["position_m"] == Json({0.0, 0.2, 0.0}));
  CHECK(scene["obstacles"][1]["moves"] == false);
  CHECK(scene["tool"]["mass"] == 0.2);
  a.ask("scene.remove", {{"name", "block"}});
  CHECK(a.obstacles() == std::vector<std::string>{"table"});
}

TEST_CASE("scene.load finds the file on the search path and replaces the whole scene", "[scene_methods]") {
  const Rig a;
  CHECK(a.ask("scene.load",
              {{"file", test::source_path("config/scenes/cube_over_plunger.toml")}})["rendering_id"] == 1);
  CHECK(a.obstacles() == std::vector<std::string>{"table", "plunger"});
  const RpcError none = a.rejected("scene.load", {{"file", "scenes/no_such.toml"}});
  CHECK(none.code() == RpcCode::rejected);
  has(none, "scenes/no_such.toml");
  CHECK(a.obstacles() == std::vector<std::string>{"table", "plunger"});
}

TEST_CASE("scene.geometry has the configured viewpoint, and none for a scene that a client loads",
          "[scene_methods][view]") {
  RunConfig plan = shipped_config();
  plan.settings.view = {{0.1, -0.2, 0.3}, {0.0, 0.0, 0.05}};
  const Rig a(plan);
  CHECK(a.ask("scene.geometry")["view"] == Json{{"eye_m", {0.1, -0.2, 0.3}}, {"target_m", {0.0, 0.0, 0.05}}});
  a.ask("scene.load", {{"file", test::source_path("config/scenes/cube_over_plunger.toml")}});
  CHECK(a.ask("scene.geometry")["view"].is_null());
  CHECK(Rig().ask("scene.geometry")["view"].is_null());
}

TEST_CASE("an invalid change is rejected with its location, and nothing changes", "[scene_methods]") {
  const Rig a;
  const Json before = a.ask("scene.get");
  const auto add = [&](const char* key, const Json& value) {
    Json block = a_block();
    block[key] = value;
    const RpcError error = a.rejected("scene.add", {{"obstacle", block}});
    CHECK(error.code() == RpcCode::rejected);
    return error;
  };
  has(add("positon_m", {0, 0, 0}), "position_m");  // the nearest key
  has(add("scale", -1.0), "scale");
  has(add("scale", "large"), "scale");
  has(add("mesh", "no_such.off"), "no_such.off");
  has(add("name", "table"), "already");
  Json null = a_block();
  null["scale"] = nullptr;
  CHECK(a.rejected("scene.add", {{"obstacle", null}}).code() == RpcCode::invalid_params);
  has(a.rejected("scene.remove", {{"name", "tabel"}}), "'tabel'");
  has(a.rejected("scene.move", {{"name", "table"}, {"position_m", {0, 0, 0}}, {"duration_s", 1.0}}),
      "half_space");
  CHECK(a.rejected("scene.move", {{"name", "table"}, {"duration_s", 1.0}}).code() == RpcCode::invalid_params);
  has(a.rejected("rendering.set", {{"wrench", {{"law", "hooke"}}}}), "law");
  has(a.rejected("rendering.set", {{"wrench", {{"stiffnes", 1.0}}}}), "stiffness");
  has(a.rejected("rendering.set", {{"rendering", {{"method", "planar"}, {"friction", {{"static", 0.5}}}}}}),
      "exact");
  CHECK(a.ask("scene.get") == before);
}

TEST_CASE(
    "an operator loads files beneath the directories of the configuration only, and reads nothing of them",
    "[scene_methods]") {
  const TemporaryDirectory dir;
  const std::string secret = "root:$6$sEcReT:19000:0:99999:7:::";
  const std::filesystem::path shadow = dir.write("private/shadow", secret + "\nOFF\n");
  dir.write("scenes/broken.off", secret + "\nOFF\n");
  dir.write("scenes/broken.toml", secret + "\n");
  std::filesystem::create_symlink(shadow, dir.path() / "scenes/link.off");
  std::filesystem::create_symlink(shadow, dir.path() / "scenes/link.toml");
  std::filesystem::copy_file(test::source_path("config/meshes/cube.off"), dir.path() / "scenes/cube.off");
  RunConfig plan = shipped_config();
  plan.settings.scene = dir.path() / "scenes/configured.toml";
  const Rig a(plan);
  const auto add = [&](const std::filesystem::path& mesh) {
    Json block = a_block();
    block["mesh"] = mesh.string();
    return Json{{"obstacle", block}};
  };
  const auto refuses = [&](const char* method, const Json& params, const char* part) {
    const RpcError error = a.rejected(method, params, Role::operator_);
    has(error, part);
    CHECK(std::string(error.what()).find("sEcReT") == std::string::npos);
  };
  refuses("scene.add", add(dir.path() / "scenes/link.off"), "symbolic link");
  refuses("scene.add", add(dir.path() / "scenes/broken.off"), "broken.off:1: is not a mesh that can be used");
  refuses("scene.load", {{"file", (dir.path() / "scenes/link.toml").string()}}, "symbolic link");
  refuses("scene.load", {{"file", (dir.path() / "scenes/broken.toml").string()}}, "broken.toml:1:");
  // The answer does not say whether the file exists.
  for (const auto& file : {shadow, dir.path() / "private/none"}) {
    refuses("scene.add", add(file), "outside of the directories");
    refuses("scene.load", {{"file", file.string()}}, "outside of the directories");
    refuses("scene.load",
            {{"file", (dir.path() / "scenes/../private").string() + "/" + file.filename().string()}},
            "outside of the directories");
  }
  CHECK(a.obstacles() == std::vector<std::string>{"table"});
  CHECK(a.ask("scene.add", add(dir.path() / "scenes/cube.off"), Role::operator_)["name"] == "block");
  // Whoever may configure reads why.
  Json other = add(dir.path() / "scenes/broken.off");
  other["obstacle"]["name"] = "other";
  has(a.rejected("scene.add", other), "sEcReT");
}

TEST_CASE("rendering.get states each value, and rendering.set what has changed", "[scene_methods]") {
  const Rig a;
  const auto row = [&](const char* name) {
    const Json result = a.ask("rendering.get", Json::object(), Role::observer);
    for (const Json& one : result["settings"])
      if (one["name"] == name) return one;
    return Json();
  };
  CHECK(row("wrench.law") == Json({{"name", "wrench.law"},
                                   {"value", "energy"},
                                   {"unit", ""},
                                   {"expected", "\"pid\" or \"energy\""},
                                   {"words", {"pid", "energy"}}}));
  CHECK(row("wrench.stiffness.linear_N_per_m") == Json({{"name", "wrench.stiffness.linear_N_per_m"},
                                                        {"value", 600.0},
                                                        {"unit", "N/m"},
                                                        {"expected", "a number from 0 to 100000 N/m"},
                                                        {"unused", "only wrench.law pid uses it"}}));
  const Json result =
      a.ask("rendering.set",
            {{"wrench",
              {{"law", "pid"}, {"stiffness", {{"linear_N_per_m", 900.0}, {"angular_Nm_per_rad", 1.5}}}}}});
  CHECK(result["changed"] ==
        Json::array({{{"name", "wrench.law"}, {"unit", ""}, {"before", "energy"}, {"now", "pid"}},
                     {{"name", "wrench.stiffness.linear_N_per_m"},
                      {"unit", "N/m"},
                      {"before", 600.0},
                      {"now", 900.0}}}));
  CHECK(row("wrench.stiffness.linear_N_per_m")["value"] == 900.0);
  a.rejected("rendering.set", {{"wrench", {{"law", "energy"}, {"integral_limit_N", 1000.0}}}});
  CHECK(row("wrench.law")["value"] == "pid");
}

TEST_CASE("scene.get states where a moved obstacle is now", "[scene_methods]") {
  Rig a;
  a.ask("scene.add", {{"obstacle", a_block()}});
  a.s.run(0.5);
  a.ask("scene.move", {{"name", "block"}, {"position_m", {0.0, 0.3, 0.0}}, {"duration_s", 0.5}});
  const auto y = [&] { return a.ask("scene.get")["obstacles"][1]["position_m"][1].get<double>(); };
  CHECK(y() == Approx(0.2));
  a.s.run(0.45);  // 0.2 s pass before the motion starts
  CHECK(y() > 0.21);
  CHECK(y() < 0.29);
  a.s.run(1.0);
  CHECK(y() == Approx(0.3));
}

TEST_CASE("workspace.get returns what workspace.set has set", "[scene_methods]") {
  const Rig a;
  a.ask("workspace.set", {{"scale", 2.0}});
  CHECK(a.ask("workspace.get", Json::object(), Role::observer) ==
        Json({{"scale", 2.0}, {"clutched", false}}));
}

TEST_CASE("workspace.set applies all values or none", "[scene_methods]") {
  const Rig a;
  const Json unchanged = a.ask("workspace.set");
  CHECK(unchanged == Json({{"scale", 1.0}, {"clutched", false}}));
  const RpcError error = a.rejected("workspace.set", {{"scale", 100.0}, {"clutched", true}});
  CHECK(error.code() == RpcCode::rejected);
  has(error, "0.1 to 10");
  CHECK(a.ask("workspace.set") == unchanged);
  CHECK(a.ask("workspace.set", {{"scale", 2.0}, {"clutched", true}}) ==
        Json({{"scale", 2.0}, {"clutched", true}}));
}

TEST_CASE("a local model requires its kind, its parameters and a lifetime", "[scene_methods]") {
  const Rig a;
  const Json plane = {{"id", 7},           {"kind", "plane"},
                      {"lifetime_s", 1.0}, {"normal", {0, 0, 1}},
                      {"offset_m", 0.005}, {"stiffness_N_per_m", 200.0}};
  CHECK(a.ask("model.set", plane) == Json::object());
  CHECK(a.ask("model.remove", {{"id", 7}}) == Json::object());
  const auto with = [&](const char* key, const Json& value) {
    Json other = plane;
    if (value.is_null())
      other.erase(key);
    else
      other[key] = value;
    return a.rejected("model.set", other);
  };
  has(with("kind", "plan"), "plane, spring, damping");
  has(with("normal", nullptr), "'normal'");
  has(with("kind", "spring"), "'position_m'");
  has(with("id", -1), "0 to 4294967295");
  has(with("lifetime_s", 11.0), "lifetime_s");
  has(with("normal", {0, 0, 0}), "normal");
  has(with("stiffness_N_per_m", -5.0), "stiffness_N_per_m");
  CHECK(with("lifetime_s", nullptr).code() == RpcCode::invalid_params);
}

TEST_CASE("an observer can change nothing, and only an administrator can reload", "[scene_methods]") {
  Rig a;
  for (const auto& [name, row] : a.table.methods()) {
    if (row.min_role == Role::observer) continue;
    INFO(name);
    CHECK(a.rejected(name, Json::object(), Role::observer).code() == RpcCode::permission_denied);
  }
  CHECK(a.rejected("reload", Json::object(), Role::operator_).code() == RpcCode::permission_denied);
  CHECK(a.reloads == 0);
  const Json answer = a.ask("reload");
  CHECK(a.reloads == 1);
  CHECK(answer["applied"] == Json({"limits"}));
  CHECK(answer["not_applied"] == Json({"servo.rate_Hz"}));
}

}  // namespace
}  // namespace wrenchd::test_scene_methods
