// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <string>
#include <thread>

#include <catch2/catch.hpp>

#include "daemon/control/wrench_methods.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_wrench_methods {

using namespace std::chrono_literals;

namespace {

using namespace test;

/// The methods on a loop in virtual time.
struct Rig {
  explicit Rig(const RunConfig& config = shipped_config()) : run(config), feed(run.runtime.loop()) {
    add_wrench_methods(table, run.runtime.loop(), feed, run.runtime.config());
  }
  Json ask(const Json& params, std::uint64_t client = 1, Role role = Role::operator_) {
    const RpcRequest request{"wrench.set", params, 1, true};
    Caller caller;
    caller.client = client;
    caller.role = role;
    caller.identity = "process " + std::to_string(client);
    return MethodTable::run(table.look_up(request, role), params, caller).result;
  }
  /// Returns the text of the error that the request is answered with.
  std::string rejection(const Json& params, std::uint64_t client = 1, Role role = Role::operator_) {
    try {
      return "accepted: " + ask(params, client, role).dump();
    } catch (const RpcError& error) {
      return error.what();
    }
  }
  Requests taken() { return run.runtime.loop().requests().take(); }

  VirtualRuntime run;
  EventFeed feed;
  MethodTable table;
};

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("wrench.set passes wrench, energy and expiry to the loop", "[wrench_methods]") {
  Rig rig;
  const TimePoint before = std::chrono::steady_clock::now();
  const Json answer = rig.ask({{"force_N", {1.0, -2.0, 3.0}},
                               {"torque_Nm", {0.1, 0.0, -0.1}},
                               {"energy_J", 0.2},
                               {"expires_s", 0.05}});
  const Requests requests = rig.taken();
  REQUIRE(requests.external_wrench);
  CHECK(requests.external_wrench->F_H_W.force_N == Vector3d(1.0, -2.0, 3.0));
  CHECK(requests.external_wrench->F_H_W.torque_Nm == Vector3d(0.1, 0.0, -0.1));
  CHECK(requests.external_wrench->energy_J == 0.2);
  CHECK(requests.external_wrench->expires - before >= 50ms);
  CHECK(requests.external_wrench->expires - before < 1s);
  CHECK(answer["expires_ns"] == requests.external_wrench->expires.time_since_epoch().count());

  rig.ask({{"force_N", {0.0, 0.0, 1.0}}});
  const Requests plain = rig.taken();
  REQUIRE(plain.external_wrench);
  CHECK(plain.external_wrench->energy_J == 0.0);
  CHECK(plain.external_wrench->F_H_W.torque_Nm == Vector3d::Zero());
}

TEST_CASE("wrench.set says which value is wrong, and changes nothing", "[wrench_methods]") {
  Rig rig;
  const Json force = {0.0, 0.0, 1.0};
  CHECK(contains(rig.rejection({{"force_N", {0.0, 0.0, 11.0}}}),
                 "'force_N' has a length of 11 N; the limits allow at most 10 N."));
  CHECK(contains(rig.rejection({{"force_N", force}, {"torque_Nm", {0.0, 0.9, 0.0}}}),
                 "'torque_Nm' has a length of 0.9 N.m; the limits allow at most 0.5 N.m."));
  CHECK(contains(rig.rejection({{"force_N", force}, {"energy_J", 1.5}}), "'energy_J' must be 0 to 1;"));
  CHECK(contains(rig.rejection({{"force_N", force}, {"energy_J", -0.1}}), "'energy_J' must be 0 to 1;"));
  CHECK(contains(rig.rejection({{"force_N", force}, {"expires_s", 1.5}}), "'expires_s' must be 0.005 to 1;"));
  CHECK(
      contains(rig.rejection({{"force_N", force}, {"expires_s", 0.001}}), "'expires_s' must be 0.005 to 1;"));
  CHECK(contains(rig.rejection({{"torque_Nm", force}}), "force_N"));
  CHECK(contains(rig.rejection({{"force_N", {0.0, 1.0}}}), "force_N"));
  CHECK(contains(rig.rejection({{"force_N", force}}, 1, Role::observer), "operator"));
  CHECK_FALSE(rig.taken().external_wrench);
}

TEST_CASE("one program at a time acts on the hand", "[wrench_methods]") {
  Rig rig;
  rig.ask({{"force_N", {0.0, 0.0, 1.0}}, {"expires_s", 0.5}}, 1);
  rig.taken();
  CHECK(contains(rig.rejection({{"force_N", {0.0, 0.0, 2.0}}}, 2),
                 "The wrench of process 1 acts; it expires in "));
  CHECK_FALSE(rig.taken().external_wrench);
  rig.ask({{"force_N", {0.0, 0.0, 0.0}}, {"expires_s", 0.005}}, 1);
  std::this_thread::sleep_for(10ms);
  rig.ask({{"force_N", {0.0, 0.0, 2.0}}}, 2);
  const Requests requests = rig.taken();
  REQUIRE(requests.external_wrench);
  CHECK(requests.external_wrench->F_H_W.force_N.z() == 2.0);
}

TEST_CASE("the event feed names the program that begins to act on the hand", "[wrench_methods]") {
  Rig rig;
  for (int i = 0; i < 3; ++i) rig.ask({{"force_N", {0.0, 0.0, 1.0}}, {"expires_s", 0.5}}, 7);
  int found = 0;
  for (const FeedEvent& event : rig.feed.stored_since(0).events)
    if (event.name == "external_wrench") {
      ++found;
      CHECK(event.text == "external wrench: process 7 acts on the hand");
      CHECK(event.fields["source"] == "process 7");
    }
  CHECK(found == 1);
}

TEST_CASE("a profile whose wrench is about the world origin takes no external wrench", "[wrench_methods]") {
  RunConfig config = shipped_config();
  config.profile.wrench_point = WrenchPoint::world_origin;
  Rig rig(config);
  CHECK(contains(rig.rejection({{"force_N", {0.0, 0.0, 1.0}}}), "needs a wrench about the handle"));
}

}  // namespace wrenchd::test_wrench_methods
