// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/wrench_methods.hpp"

#include <chrono>
#include <memory>
#include <string>

#include <spdlog/fmt/fmt.h>

#include "core/work_account.hpp"
#include "daemon/control/vector_param.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

constexpr double kMinWrenchExpiry_s = 0.005;
constexpr double kDefaultWrenchExpiry_s = 0.1;

/// The program whose wrench acts. Another one must wait until it has expired.
struct Source {
  std::uint64_t client = 0;
  std::string identity;
  TimePoint expires{};
};

ExternalWrenchRequest request_of(const Json& params, const LimitSettings& limits, TimePoint now) {
  ExternalWrenchRequest request;
  request.F_H_W = {vector_of(params, "force_N", Vector3d::Zero()),
                   vector_of(params, "torque_Nm", Vector3d::Zero())};
  check_length("force_N", request.F_H_W.force_N, limits.max_force_N, "N",
               fmt::format("the limits allow at most {:.4g} N", limits.max_force_N));
  check_length("torque_Nm", request.F_H_W.torque_Nm, limits.max_torque_Nm, "N.m",
               fmt::format("the limits allow at most {:.4g} N.m", limits.max_torque_Nm));
  request.energy_J = params.value("energy_J", 0.0);
  if (request.energy_J < 0.0 || request.energy_J > WorkAccount::kMaxBalance_J)
    throw RpcError(
        RpcCode::invalid_params,
        fmt::format("'energy_J' must be 0 to {}; declare the energy that the wrench gives to the hand "
                    "until the next call.",
                    WorkAccount::kMaxBalance_J));
  const double expires_s = params.value("expires_s", kDefaultWrenchExpiry_s);
  if (expires_s < kMinWrenchExpiry_s || expires_s > ExternalWrenchRequest::kMaxLifetime_s)
    throw RpcError(RpcCode::invalid_params,
                   fmt::format("'expires_s' must be {} to {}; set the wrench again before it expires.",
                               kMinWrenchExpiry_s, ExternalWrenchRequest::kMaxLifetime_s));
  request.expires = now + from_seconds(expires_s);
  return request;
}

MethodResult set_wrench(Source& source, ServoLoop& loop, EventFeed& feed, const RunConfig& config,
                        const Json& params, const Caller& caller) {
  if (config.profile.wrench_point == WrenchPoint::world_origin)
    throw RpcError(
        RpcCode::invalid_state,
        "An external wrench needs a wrench about the handle, and the profile of this device names the "
        "world origin.");
  const TimePoint now = std::chrono::steady_clock::now();
  const ExternalWrenchRequest request = request_of(params, loop.telemetry().limits(), now);
  const bool free = now >= source.expires;
  if (!free && source.client != caller.client)
    throw RpcError(RpcCode::invalid_state, fmt::format("The wrench of {} acts; it expires in {:.0f} ms.",
                                                       source.identity, 1e3 * seconds(source.expires - now)));
  if (free || source.client != caller.client)
    feed.emit("external_wrench", EventLevel::info,
              "external wrench: " + caller.identity + " acts on the hand", {{"source", caller.identity}});
  source = {caller.client, caller.identity, request.expires};
  loop.requests().set_external_wrench(request);
  return Json{{"expires_ns", request.expires.time_since_epoch().count()}};
}

}  // namespace

void add_wrench_methods(MethodTable& table, ServoLoop& loop, EventFeed& feed, const RunConfig& config) {
  const auto source = std::make_shared<Source>();
  table.add(MethodRow{
      "wrench.set",
      Role::operator_,
      {{"force_N", ParamType::vector, true, "force on the hand, in axes of the world"},
       {"torque_Nm", ParamType::vector, false,
        "torque on the hand about the handle point, in axes of the world; default: none"},
       {"energy_J", ParamType::number, false,
        "energy that the wrench may give to the hand from now on, beside what the hand gave to it, 0 to 1 J; "
        "default: 0 J"},
       {"expires_s", ParamType::number, false,
        "time until the wrench fades out, 0.005 to 1 s; default: 0.1 s"}},
      "Lets a robot or a simulator act on the hand. The wrench acts beside the contacts, within all limits, "
      "and "
      "it does no more work than the declared energy and the work of the hand against it pay for. Set it "
      "again "
      "before it expires; then it fades out within 50 ms. One client at a time. Returns expires_ns on "
      "CLOCK_MONOTONIC.",
      [source, &loop, &feed, &config](const Json& params, const Caller& caller) {
        return set_wrench(*source, loop, feed, config, params, caller);
      }});
}

}  // namespace wrenchd
