// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/hand_methods.hpp"

#include <chrono>
#include <string>

#include "core/clock.hpp"
#include "daemon/control/vector_param.hpp"

namespace wrenchd {
namespace {

/// Largest distance of a goal from the origin of the device base; no arm reaches farther.
constexpr double kMaxDistance_m = 1.0;
constexpr double kMaxRotation_rad = 6.2831853071795865;
constexpr double kMinExpiry_s = 0.01, kMaxExpiry_s = 60.0;
constexpr double kDefaultExpiry_s = 0.5;

HandGoal goal_of(const Json& params) {
  const Vector3d position_m = vector_of(params, "position_m", Vector3d::Zero());
  const Vector3d rotation_rad = vector_of(params, "rotation_vector_rad", Vector3d::Zero());
  check_length("position_m", position_m, kMaxDistance_m, "m", "set a goal within 1 m of the device base");
  check_length("rotation_vector_rad", rotation_rad, kMaxRotation_rad, "rad",
               "set a goal within one turn (6.28 rad)");
  const double expires_s = params.value("expires_s", kDefaultExpiry_s);
  if (expires_s < kMinExpiry_s || expires_s > kMaxExpiry_s)
    throw RpcError(RpcCode::invalid_params,
                   "'expires_s' must be 0.01 to 60; set the goal again before it expires.");
  return {{rotation_from(rotation_rad), position_m},
          std::chrono::steady_clock::now() + from_seconds(expires_s)};
}

[[noreturn]] void reject_without_hand(const RunConfig& config) {
  throw RpcError(
      RpcCode::invalid_state,
      config.simulated
          ? "The hand of this simulated device is in another process; move it by the means of that process."
          : "A person moves this device. Only the hand of a simulated device can be moved: start "
            "wrenchd with --simulate.");
}

MethodResult set_goal(DeviceInHand* device, const RunConfig& config, const Json& params) {
  const HandGoal goal = goal_of(params);
  if (device == nullptr) reject_without_hand(config);
  if (!device->set_hand_goal(goal))
    throw RpcError(RpcCode::invalid_state,
                   "The handle follows a recorded path exactly ([simulation] playback_mode = \"open\"); set "
                   "playback_mode to \"closed\", or remove the playback.");
  return Json{{"expires_ns", goal.expires.time_since_epoch().count()}};
}

}  // namespace

void add_hand_methods(MethodTable& table, DeviceInHand* device, const RunConfig& config) {
  table.add(MethodRow{
      "hand.set",
      Role::operator_,
      {{"position_m", ParamType::vector, true, "goal of the handle in the device base"},
       {"rotation_vector_rad", ParamType::vector, false,
        "rotation of the handle in the device base; default: none"},
       {"expires_s", ParamType::number, false,
        "time until the hand returns to its path, 0.01 to 60 s; default: 0.5 s"}},
      "Moves the hand of a simulated device to a pose, at the speed of a person (at most 1.25 m/s). Send it "
      "again before it expires to steer the hand; afterwards the hand returns to its path. Returns "
      "expires_ns, the time at which the goal expires, on CLOCK_MONOTONIC.",
      [device, &config](const Json& params, const Caller&) { return set_goal(device, config, params); }});
}

}  // namespace wrenchd
