// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/wait_text.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <spdlog/fmt/fmt.h>

#include "core/transitions.hpp"

namespace wrenchd {
namespace {

/// Shortest displacement and smallest rotation that a person is asked for.
constexpr double kShortest_m = 0.5e-3;
constexpr double kSmallest_rad = 0.5 * std::numbers::pi / 180.0;

/// The displacement in words if it is nearly along one axis of the world (x forward, y left, z up), otherwise
/// its components.
std::string displacement_text(const std::array<double, 3>& d_W_m) {
  constexpr std::array kWords = {std::array{"forward (+x)", "back (-x)"},
                                 std::array{"left (+y)", "right (-y)"}, std::array{"up (+z)", "down (-z)"}};
  constexpr double kNearly = 0.95;
  const double length_m = std::hypot(d_W_m[0], d_W_m[1], d_W_m[2]);
  for (std::size_t i = 0; i < 3; ++i)
    if (std::abs(d_W_m[i]) >= kNearly * length_m)
      return fmt::format("{:.0f} mm {}", std::ceil(1e3 * length_m), kWords[i][d_W_m[i] < 0.0 ? 1 : 0]);
  return fmt::format("by ({:.0f}, {:.0f}, {:.0f}) mm in x, y, z of the world", 1e3 * d_W_m[0], 1e3 * d_W_m[1],
                     1e3 * d_W_m[2]);
}

/// How the handle gets to where the contacts do not push.
std::string way_out(const WaitReason& r) {
  const bool moves = std::hypot(r.to_proxy_W_m[0], r.to_proxy_W_m[1], r.to_proxy_W_m[2]) > kShortest_m;
  const bool turns = r.to_proxy_rad > kSmallest_rad;
  const std::string turn =
      fmt::format("turn it {:.0f} deg", std::ceil(r.to_proxy_rad * 180.0 / std::numbers::pi));
  if (moves && turns) return "move the handle " + displacement_text(r.to_proxy_W_m) + " and " + turn;
  if (moves) return "move the handle " + displacement_text(r.to_proxy_W_m);
  if (turns) return turn + " back, with the tool";
  return "move the handle away from the obstacle or local model that pushes";
}

}  // namespace

std::string wait_text(const WaitReason& r) {
  using Kind = WaitReason::Kind;
  switch (r.kind) {
    case Kind::none:
      return {};
    case Kind::no_report:
      if (r.value == 0.0) return "no report has arrived from the device: check its cable, and its profile";
      return fmt::format("no report from the device for {:.1f} s: check its cable", r.value);
    case Kind::not_homed:
      return "the device is not homed: move the handle through its reference, as the device's manual states";
    case Kind::fault: {
      const FaultRow& row = fault_row(r.fault);
      return fmt::format("{} ({}): {}", row.message, row.name, row.cure);
    }
    case Kind::proxy_search:
      return "wrenchd searches the admissible pose nearest to the tool";
    case Kind::no_room:
      return "the tool does not fit where the handle is: move the handle to where the tool has room";
    case Kind::handle_moves:
      return fmt::format("the handle moves at {:.2f} m/s: hold it below {:.2f} m/s", r.value, r.limit);
    case Kind::handle_turns:
      return fmt::format("the handle turns at {:.1f} rad/s: hold it below {:.1f} rad/s", r.value, r.limit);
    case Kind::contact_pushes:
      return fmt::format("arming would push {:.1f} N, at most {:.2g} N is allowed: {}", r.value, r.limit,
                         way_out(r));
    case Kind::contact_twists:
      return fmt::format("arming would twist {:.0f} mN.m, at most {:.2g} mN.m is allowed: {}", 1e3 * r.value,
                         1e3 * r.limit, way_out(r));
  }
  return {};
}

std::string no_force_text(State state, Fault cause, const WaitReason& reason, const DeviceProfile& profile) {
  const std::string waits = wait_text(reason);
  switch (state) {
    case State::disconnected:
      return "no device: plug in the device of profile '" + profile.name + "'";
    case State::self_test:
      return waits.empty() ? "the self-test checks reports and watchdog of the device" : waits;
    case State::disarmed:
      return "not armed: wrenchctl arm";
    case State::waiting:
      return waits;
    case State::releasing:
      return "the force fades out";
    case State::degraded:
    case State::fault:
    case State::stopped: {
      const FaultRow& row = fault_row(cause);
      const std::string text =
          cause == Fault::none ? "stopped" : fmt::format("{}: {}", row.message, row.cure);
      return is_latched(state) && text.find("acknowledge") == std::string::npos
                 ? text + "; then wrenchctl acknowledge"
                 : text;
    }
    case State::shutdown:
      return "wrenchd ends";
    case State::ramping:
    case State::active:
      return profile.has_output
                 ? ""
                 : "the device has no motors: wrenchd computes and shows the wrench, and sends none";
  }
  return {};
}

}  // namespace wrenchd
