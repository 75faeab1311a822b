// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/control/hand_methods.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_hand_methods {

using namespace std::chrono_literals;

namespace {

using namespace test;

struct Ignore final : ReportSink {
  void take_report(TimePoint, std::span<const std::uint8_t>) noexcept override {}
};

Json ask(const MethodTable& table, const Json& params, Role role = Role::operator_) {
  const RpcRequest request{"hand.set", params, 1, true};
  Caller caller;
  caller.role = role;
  return MethodTable::run(table.look_up(request, role), params, caller).result;
}

/// Returns the text of the error that the request is answered with.
std::string rejection(const MethodTable& table, const Json& params, Role role = Role::operator_) {
  try {
    return "accepted: " + ask(table, params, role).dump();
  } catch (const RpcError& error) {
    return error.what();
  }
}

SimulationSettings recorded_path() {
  SimulationSettings settings;
  settings.hand_path = {{0.0, {0.0, 0.0, 0.065}, {0, 0, 0}}};
  settings.playback_mode = PlaybackMode::open;
  settings.playback_path = {{0.0, {}}, {1.0, {}}};
  return settings;
}

}  // namespace

TEST_CASE("hand.set moves the hand of the simulated device, until it expires", "[hand_methods]") {
  RunConfig config = shipped_config();
  config.settings.simulation.hand_path = {{0.0, {0.0, 0.0, 0.065}, {0, 0, 0}}};
  config.settings.simulation.hand_repeats = false;
  SimulatedDevice device(config.profile, config.settings.simulation);
  MethodTable table;
  add_hand_methods(table, &device, config);
  Ignore host;
  const TimePoint start = std::chrono::steady_clock::now();
  device.advance_to(start, host);
  const Json answer =
      ask(table, {{"position_m", {0.05, 0.0, 0.1}}, {"rotation_vector_rad", {0.0, 0.3, 0.0}}});
  const TimePoint expires{std::chrono::nanoseconds(answer["expires_ns"].get<std::int64_t>())};
  CHECK(expires - std::chrono::steady_clock::now() < 500ms);
  for (TimePoint t = start; t < expires - 1ms; t += 100ms) device.advance_to(t, host);
  device.advance_to(expires - 1ms, host);
  CHECK((device.hand_target().X_BG.translation_m - Vector3d(0.05, 0.0, 0.1)).norm() < 1e-4);
  CHECK((device.X_BH().translation_m - Vector3d(0.05, 0.0, 0.1)).norm() < 2e-3);
  CHECK(rotation_vector(device.X_BH().rotation).y() == Approx(0.3).margin(0.02));
  device.advance_to(expires + 900ms, host);
  CHECK(device.hand_target().X_BG.translation_m == Vector3d(0.0, 0.0, 0.065));
}

TEST_CASE("hand.set says why a hand cannot be moved", "[hand_methods]") {
  const RunConfig config = shipped_config();
  SimulatedDevice device(config.profile, config.settings.simulation);
  MethodTable table;
  add_hand_methods(table, &device, config);
  const Json there = {{"position_m", {0.0, 0.0, 0.1}}};
  CHECK(rejection(table, there).starts_with("accepted"));
  CHECK(rejection(table, there, Role::observer).find("operator") != std::string::npos);
  CHECK(rejection(table, Json::object()).find("position_m") != std::string::npos);
  CHECK(rejection(table, {{"position_m", {0.0, 3.0, 0.1}}}) ==
        "'position_m' has a length of 3.002 m; set a goal within 1 m of the device base.");
  CHECK(rejection(table, {{"position_m", {0, 0, 0}}, {"rotation_vector_rad", {0, 0, 7}}})
            .find("within one turn") != std::string::npos);
  for (const double expires_s : {0.0, -1.0, 61.0})
    CHECK(rejection(table, {{"position_m", {0, 0, 0}}, {"expires_s", expires_s}}).find("0.01 to 60") !=
          std::string::npos);

  SimulatedDevice on_path(config.profile, recorded_path());
  MethodTable recorded;
  add_hand_methods(recorded, &on_path, config);
  CHECK(rejection(recorded, there).find("playback_mode to \"closed\"") != std::string::npos);

  MethodTable elsewhere;
  add_hand_methods(elsewhere, nullptr, config);
  CHECK(rejection(elsewhere, there).find("in another process") != std::string::npos);
  RunConfig real = shipped_config();
  real.simulated = false;
  MethodTable by_a_person;
  add_hand_methods(by_a_person, nullptr, real);
  CHECK(rejection(by_a_person, there).find("--simulate") != std::string::npos);
}

}  // namespace wrenchd::test_hand_methods
