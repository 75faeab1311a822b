// SPDX-License-Identifier: GPL-3.0-or-later
#include <cctype>
#include <set>

#include <catch2/catch.hpp>

#include "config/config_error.hpp"
#include "config/setting_table.hpp"
#include "tests/support/control_rig.hpp"

namespace wrenchd::test_control_methods {

namespace {

using namespace test;

/// All methods of the daemon, on a runtime that does not tick.
struct Table {
  VirtualRuntime s{resting_config()};
  EventFeed feed{s.runtime.loop()};
  ControlInterface control{s.runtime, feed};
  const MethodTable& methods = control.methods();
};

RpcError rejected(const MethodTable& table, const std::string& method, const Json& params, Role role) {
  try {
    table.look_up({method, params, 1, true}, role);
  } catch (const RpcError& error) {
    return error;
  }
  FAIL("method '" << method << "' takes " << params.dump());
  throw std::logic_error("not reached");
}

bool says(const RpcError& error, const std::string& text) {
  return std::string(error.what()).find(text) != std::string::npos;
}

/// Returns a value of the type.
Json value_of(ParamType type) {
  switch (type) {
    case ParamType::boolean:
      return true;
    case ParamType::integer:
      return 3;
    case ParamType::number:
      return 2.5;
    case ParamType::text:
      return "text";
    case ParamType::texts:
      return Json::array({"a", "b"});
    case ParamType::vector:
      return Json::array({1, 2.5, -3});
    case ParamType::object:
      return Json::object();
  }
  return nullptr;
}

const std::vector<Json> kWrongForAll = {nullptr, Json::array({1, "a"}), Json::array({1.0, 2.0})};

/// Returns every parameter with a value of its type.
Json good_params(const MethodRow& row) {
  Json params = Json::object();
  for (const ParamRow& param : row.params) params[param.name] = value_of(param.type);
  return params;
}

TEST_CASE("every method is documented, accepts its own parameters and rejects all others",
          "[control_methods]") {
  const Table t;
  REQUIRE(t.methods.methods().size() >= 13);
  for (const auto& [name, row] : t.methods.methods()) {
    INFO(name);
    CHECK(row.name == name);
    CHECK(row.doc.size() > 10);
    CHECK(row.doc.back() == '.');
    CHECK(static_cast<bool>(row.run));
    for (const char c : name) CHECK((std::islower(static_cast<unsigned char>(c)) || c == '.' || c == '_'));
    const Json good = good_params(row);
    CHECK(&t.methods.look_up({name, good, 1, true}, row.min_role) == &row);

    Json more = good;
    more["no_such_thing"] = 1;
    const RpcError unknown = rejected(t.methods, name, more, Role::administrator);
    CHECK(unknown.code() == RpcCode::invalid_params);
    CHECK(says(unknown, "'no_such_thing'"));
    for (const ParamRow& param : row.params) {
      INFO(param.name);
      CHECK(param.doc.size() > 5);
      for (const Json& wrong : kWrongForAll) {
        Json bad = good;
        bad[param.name] = wrong;
        const RpcError error = rejected(t.methods, name, bad, Role::administrator);
        CHECK(error.code() == RpcCode::invalid_params);
        CHECK(says(error, "'" + param.name + "' must be " + type_text(param.type)));
      }
      Json less = good;
      less.erase(param.name);
      if (param.required) CHECK(says(rejected(t.methods, name, less, Role::administrator), "is missing"));
      if (!param.required) CHECK_NOTHROW(t.methods.look_up({name, less, 1, true}, row.min_role));
    }
  }
}

TEST_CASE("every method rejects each role below its minimum role, with any parameters", "[control_methods]") {
  const Table t;
  int rejections = 0;
  for (const auto& [name, row] : t.methods.methods())
    for (const Role role : {Role::observer, Role::operator_}) {
      if (role >= row.min_role) continue;
      INFO(name);
      for (const Json& params : {good_params(row), Json{{"no_such_thing", 1}}}) {
        const RpcError error = rejected(t.methods, name, params, role);
        CHECK(error.code() == RpcCode::permission_denied);
        CHECK(error.details()["min_role"] == wrenchd::name(row.min_role));
        CHECK(says(error, "group '"));
        ++rejections;
      }
    }
  CHECK(rejections >= 10);
}

TEST_CASE("observers may stop and read; arming requires the role operator", "[control_methods]") {
  const Table t;
  for (const char* open : {"describe", "status", "subscribe", "unsubscribe", "stop", "devices"})
    CHECK(t.methods.methods().at(open).min_role == Role::observer);
  for (const char* closed : {"lease.acquire", "lease.release", "lease.heartbeat", "arm", "disarm",
                             "acknowledge", "reinitialize_proxy", "grasp", "let_go"})
    CHECK(t.methods.methods().at(closed).min_role == Role::operator_);
}

TEST_CASE("an unknown method or parameter is rejected with the nearest known name", "[control_methods]") {
  const Table t;
  const RpcError error = rejected(t.methods, "lease_acquire", Json::object(), Role::observer);
  CHECK(error.code() == RpcCode::method_not_found);
  CHECK(says(error, "did you mean 'lease.acquire'?"));
  CHECK(says(rejected(t.methods, "subscribe", {{"event", Json::array()}}, Role::observer),
             "there is no parameter 'event'; did you mean 'events'?"));
  CHECK(rejected(t.methods, std::string(60000, 'x'), Json::object(), Role::observer).code() ==
        RpcCode::method_not_found);
}

TEST_CASE("describe returns each key of the setting table once, with the effect of its reload",
          "[control_methods]") {
  const Table t;
  const Json description = t.methods.describe();
  std::set<std::string> described;
  for (const Json& setting : description["settings"]) {
    CHECK(described.insert(setting["name"]).second);
    CHECK(setting["on_reload"].get<std::string>().size() > 5);
  }
  std::set<std::string> keys;
  for (const Setting& setting : setting_table())
    if (setting.read != nullptr) keys.insert(setting.name());
  CHECK(described == keys);
}

TEST_CASE("describe returns every method, event, error and role", "[control_methods]") {
  const Table t;
  const Json described = t.methods.describe();
  CHECK(described["protocol"] == 2);
  CHECK(described["methods"].size() == t.methods.methods().size());
  for (const Json& method : described["methods"]) {
    const MethodRow& row = t.methods.methods().at(method["name"].get<std::string>());
    CHECK(method["min_role"] == name(row.min_role));
    CHECK(method["doc"] == row.doc);
    CHECK(method["params"].size() == row.params.size());
  }
  std::set<std::string> events;
  for (const Json& event : described["events"]) {
    events.insert(event["name"].get<std::string>());
    CHECK(event["doc"].get<std::string>().size() > 10);
  }
  for (const char* name :
       {"state", "fault", "device", "lease", "stiffness", "proxy_initialization", "events_lost"})
    CHECK(events.count(name) == 1);
  CHECK(described["errors"].size() == 9);
  for (const Json& error : described["errors"]) CHECK(error["code"].get<int>() < 0);
  CHECK(described["roles"]["administrator"].get<std::string>().find("group 'daemon'") != std::string::npos);
}

TEST_CASE("each exception of a method becomes an error response with a code", "[control_methods]") {
  const auto thrown = [](const auto& error) {
    MethodTable table;
    table.add(
        MethodRow{"fail", Role::observer, {}, "Fails.", [&](const Json&, const Caller&) -> MethodResult {
                    throw error;
                  }});
    try {
      MethodTable::run(table.methods().at("fail"), Json::object(), {});
    } catch (const RpcError& rejection) {
      return rejection;
    }
    throw std::logic_error("nothing was thrown");
  };
  CHECK(thrown(RpcError(RpcCode::lease_held, "Taken.")).code() == RpcCode::lease_held);
  const RpcError config = thrown(ConfigError("scene.toml", SourceLocation{3, 4}, "is wrong; mend it"));
  CHECK(config.code() == RpcCode::rejected);
  CHECK(says(config, "scene.toml:3:4: is wrong; mend it"));
  const RpcError internal = thrown(std::runtime_error("the disk is full"));
  CHECK(internal.code() == RpcCode::internal_error);
  CHECK(says(internal, "the disk is full"));
}

TEST_CASE("a method or event cannot be added twice", "[control_methods]") {
  Table t;
  CHECK_THROWS_AS(t.control.methods().add(MethodRow{"stop", Role::observer, {}, "Again.", {}}),
                  std::logic_error);
  CHECK_THROWS_AS(t.control.methods().add(EventRow{"state", "Again."}), std::logic_error);
}

}  // namespace
}  // namespace wrenchd::test_control_methods
