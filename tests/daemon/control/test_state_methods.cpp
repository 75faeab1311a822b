// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>

#include <catch2/catch.hpp>

#include "daemon/control/scene_methods.hpp"
#include "daemon/control/state_methods.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_state_methods {

namespace {

using namespace test;

TEST_CASE("obstacle names come with the number of their rendering, also after a change of the scene",
          "[state_methods]") {
  VirtualRuntime s(shipped_config());
  MethodTable table;
  add_state_methods(table, s.runtime);
  add_scene_methods(table, s.runtime.reconfigurator(), [] { return ReloadResult{}; });
  const auto ask = [&](const std::string& method, const Json& params = Json::object()) {
    return MethodTable::run(table.look_up({method, params, 1, true}, Role::administrator), params, {});
  };
  CHECK(ask("state.obstacles").result == Json({{"obstacles", {"table"}}, {"rendering_id", 0}}));
  const MethodResult first = ask("state.open");
  CHECK(first.fd >= 0);
  CHECK(first.result["layout"]["rendering_id"] == 0);
  CHECK(first.result["layout"]["obstacles"] == Json::array({"table"}));

  ask("scene.load", {{"file", test::source_path("config/scenes/cube_over_plunger.toml")}});
  CHECK(ask("state.obstacles").result == Json({{"obstacles", {"table", "plunger"}}, {"rendering_id", 1}}));
  CHECK(ask("state.open").result["layout"]["obstacles"] == Json({"table", "plunger"}));
  CHECK(ask("state.open").result["layout"]["rendering_id"] == 1);
}

}  // namespace
}  // namespace wrenchd::test_state_methods
