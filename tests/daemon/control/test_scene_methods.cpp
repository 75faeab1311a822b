// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <catch2/catch.hpp>

#include "config/load_scene.hpp"
#include "daemon/control/scene_methods.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

// Clients read and change the rendering: each request is looked up in the method table, with a role and
// parameters in JSON.

namespace wrenchd {
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
          {"mesh", WRENCHD_SOURCE_DIR "/config/meshes/cube.off"},
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
              {{"file", WRENCHD_SOURCE_DIR "/config/scenes/cube_over_plunger.toml"}})["rendering_id"] == 1);
  CHECK(a.obstacles() == std::vector<std::string>{"table", "plunger"});
  const RpcError none = a.rejected("scene.load", {{"file", "scenes/no_such.toml"}});
  CHECK(none.code() == RpcCode::rejected);
  has(none, "scenes/no_such.toml");
  CHECK(a.obstacles() == std::vector<std::string>{"table", "plunger"});
}

namespace fs = std::filesystem;

void has_not(const RpcError& error, const std::string& part) {
  INFO(error.what());
  CHECK(std::string(error.what()).find(part) == std::string::npos);
}

/// The configured scene in a directory of its own, beside a file that nobody may learn of.
struct Private {
  TemporaryDirectory files;
  fs::path scene, secret;
  RunConfig plan = shipped_config();

  Private() {
    fs::create_directory(files.path() / "scenes");
    std::ifstream cube(WRENCHD_SOURCE_DIR "/config/meshes/cube.off");
    files.write("scenes/cube.off", std::string(std::istreambuf_iterator<char>(cube), {}));
    scene = files.write("scenes/scene.toml", "[tool]\nmesh = \"cube.off\"\nscale = 0.001\n");
    secret = files.write("secret", "root:x:0:0 very secret");
    plan.settings.scene = scene;
    plan.scene = load_scene(scene, &plan.texts);
  }
};

TEST_CASE("an operator loads only scenes and meshes beneath the directories of scenes, without links",
          "[scene_methods][trust]") {
  Private p;
  const Rig a(p.plan);
  const auto load = [&](const fs::path& file) {
    return a.rejected("scene.load", {{"file", file.string()}}, Role::operator_);
  };
  const fs::path next = p.files.write("scenes/next.toml", "[tool]\nmesh = \"cube.off\"\nscale = 0.001\n");
  CHECK_NOTHROW(a.ask("scene.load", {{"file", next.string()}}, Role::operator_));
  CHECK_NOTHROW(a.ask("scene.load", {{"file", "scenes/cube_over_plunger.toml"}}, Role::operator_));

  // Outside: the same answer whether the file exists or not.
  const std::string is_outside = "is outside the directories that you may use";
  const fs::path outside =
      p.files.write("outside.toml", "[tool]\nmesh = \"scenes/cube.off\"\nscale = 0.001\n");
  has(load(outside), is_outside);
  has(load(p.files.path() / "no_such.toml"), is_outside);
  has(load(p.files.path() / "scenes/../outside.toml"), is_outside);
  has(load("../../../../../../../../etc/passwd"), is_outside);
  CHECK_NOTHROW(a.ask("scene.load", {{"file", outside.string()}}));  // an administrator may

  // Links.
  fs::create_symlink(p.secret, p.files.path() / "scenes/link.toml");
  const RpcError link = load(p.files.path() / "scenes/link.toml");
  has(link, "symbolic link");
  has_not(link, "root:x");
  fs::create_symlink(p.secret, p.files.path() / "scenes/link.off");
  const fs::path linked = p.files.write("scenes/linked.toml", "[tool]\nmesh = \"link.off\"\n");
  has(load(linked), "symbolic link");
  has_not(load(linked), "root:x");

  // Meshes.
  const fs::path far = p.files.write("scenes/far.toml", "[tool]\nmesh = \"../secret.off\"\n");
  p.files.write("secret.off", "root:x:0:0 very secret");
  has(load(far), is_outside);
  const auto add = [&](const std::string& mesh) {
    return a.rejected("scene.add", {{"obstacle", {{"mesh", mesh}}}}, Role::operator_);
  };
  a.ask("scene.load", {{"file", p.scene.string()}}, Role::operator_);
  has(add("../secret.off"), is_outside);
  has(add((p.files.path() / "secret.off").string()), is_outside);
  has(add("/no/such.off"), is_outside);
  has(add("link.off"), "symbolic link");
}

TEST_CASE("errors quote content of files only to administrators", "[scene_methods][trust]") {
  Private p;
  const Rig a(p.plan);
  const Json bad = {{"file", p.files.write("scenes/bad.toml", "root:x:0:0\n").string()}};
  has(a.rejected("scene.load", bad), "bad.toml:1");
  const RpcError told = a.rejected("scene.load", bad, Role::operator_);
  has(told, "bad.toml:1");
  has(told, "wrenchctl check");
  has_not(told, "root");
  p.files.write("scenes/bad.off", "OFF\n4 4 6\nroot:x:0:0 1 2\n");
  const Json add = {{"obstacle", {{"mesh", "bad.off"}}}};
  has(a.rejected("scene.add", add), "root:x:0:0");
  const RpcError mesh = a.rejected("scene.add", add, Role::operator_);
  has(mesh, "bad.off:3");
  has_not(mesh, "root");
  // What is wrong in the request itself is told.
  has(a.rejected("scene.add", {{"obstacle", {{"mesh", "cube.off"}, {"scale", "huge"}}}}, Role::operator_),
      "huge");
}

TEST_CASE("a recording contains the bytes that were loaded, whatever their names refer to later",
          "[scene_methods][trust]") {
  Private p;
  const Rig a(p.plan);
  const std::string scene_text = a.s.runtime.recording_header().scene;
  CHECK(scene_text == "[tool]\nmesh = \"cube.off\"\nscale = 0.001\n");
  const auto mesh_in = [&](const std::string& role) {
    const RecordingHeader header = a.s.runtime.recording_header();
    for (const RecordedFile& file : header.files)
      if (file.role == role) return file.bytes;
    return std::string("not there");
  };
  const std::string cube = mesh_in("tool");
  CHECK(cube.starts_with("OFF"));
  // Somebody replaces the mesh by a link, and the scene by another text.
  fs::remove(p.files.path() / "scenes/cube.off");
  fs::create_symlink(p.secret, p.files.path() / "scenes/cube.off");
  p.files.write("scenes/scene.toml", "root:x:0:0 very secret");
  CHECK(mesh_in("tool") == cube);
  CHECK(a.s.runtime.recording_header().scene == scene_text);
  // An operator adds and removes an obstacle, which builds the scene again.
  p.files.write("scenes/post.off", cube);
  const Json post = {{"obstacle", {{"mesh", "post.off"}, {"scale", 0.001}, {"position_m", {0.0, 0.3, 0.0}}}}};
  const Json added = a.ask("scene.add", post, Role::operator_);
  CHECK(mesh_in("tool") == cube);
  CHECK(mesh_in("obstacle_0") == cube);
  a.ask("scene.remove", {{"name", added["name"]}}, Role::operator_);
  CHECK(mesh_in("tool") == cube);
  CHECK(mesh_in("obstacle_0") == "not there");
}

TEST_CASE("the event of a rejected reload, which every observer receives, quotes no content",
          "[scene_methods][trust]") {
  Private p;
  Rig a(p.plan);
  EventFeed feed(a.s.runtime.loop());
  const fs::path bad = p.files.write("scenes/bad.toml", "root:x:0:0\n");
  CHECK_THROWS_AS(reload_config(a.s.runtime.reconfigurator(), feed,
                                [&]() -> RunConfig {
                                  return load_run_config({bad, {}, {}, false}, SearchPath());
                                }),
                  ConfigError);
  const EventFeed::Batch events = feed.events_since(0, {"reload"}, 1 << 20);
  REQUIRE(events.lines.size() == 1);
  CHECK_THAT(events.lines.front(), Catch::Contains("bad.toml:1") && !Catch::Contains("root"));
}

TEST_CASE("scene.geometry has the configured viewpoint, and none for a scene that a client loads",
          "[scene_methods][view]") {
  RunConfig plan = shipped_config();
  plan.settings.view = {{0.1, -0.2, 0.3}, {0.0, 0.0, 0.05}};
  const Rig a(plan);
  CHECK(a.ask("scene.geometry")["view"] == Json{{"eye_m", {0.1, -0.2, 0.3}}, {"target_m", {0.0, 0.0, 0.05}}});
  a.ask("scene.load", {{"file", WRENCHD_SOURCE_DIR "/config/scenes/cube_over_plunger.toml"}});
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
}  // namespace wrenchd
