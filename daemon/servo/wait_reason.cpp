// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/wait_reason.hpp"

#include "core/watch_limits.hpp"
#include "daemon/servo/demand.hpp"
#include "devices/device.hpp"

namespace wrenchd {
namespace {

using Kind = WaitReason::Kind;

/// Faults that restart the calm time. Faults for information do not.
Fault interrupting_fault(FaultSet faults) noexcept {
  for (; faults != 0; faults &= faults - 1) {
    const Trigger trigger = fault_row(first_fault(faults)).trigger;
    if (trigger == Trigger::soft_fault || trigger == Trigger::interrupted) return first_fault(faults);
  }
  return Fault::none;
}

WaitReason reason(Kind kind, double value = 0.0, double limit = 0.0) noexcept {
  WaitReason r;
  r.kind = kind;
  r.value = value;
  r.limit = limit;
  return r;
}

/// The first condition that does not hold: those of the device before those of the contact.
WaitReason uncalm_reason(const Demand& demand) noexcept {
  const CalmCondition& calm = demand.calm;
  if (!calm.proxy_valid)
    return reason(demand.contact.initialization == ProxyInitialization::failed ? Kind::no_room
                                                                               : Kind::proxy_search);
  if (!calm.is_slow()) return reason(Kind::handle_moves, calm.speed_m_per_s, kCalmSpeed_m_per_s);
  if (!calm.turns_slowly())
    return reason(Kind::handle_turns, calm.angular_speed_rad_per_s, kCalmAngularSpeed_rad_per_s);
  WaitReason r;
  if (!calm.force_is_small())
    r = reason(Kind::contact_pushes, calm.force_N, calm.max_force_N);
  else if (!calm.torque_is_small())
    r = reason(Kind::contact_twists, calm.torque_Nm, calm.max_torque_Nm);
  r.to_proxy_W_m = calm.to_proxy_W_m;
  r.to_proxy_rad = calm.to_proxy_rad;
  return r;
}

}  // namespace

WaitReason wait_reason(State state, FaultSet faults, const DeviceSample& sample, const Demand& demand,
                       TimePoint now) noexcept {
  if (state != State::waiting && state != State::self_test) return {};
  if (sample.arrived == TimePoint{}) return reason(Kind::no_report);
  if (const Duration age = now - sample.arrived; age > kStaleSample)
    return reason(Kind::no_report, seconds(age));
  if (!sample.homed) return reason(Kind::not_homed);
  if (const Fault fault = interrupting_fault(faults); fault != Fault::none) {
    WaitReason r = reason(Kind::fault);
    r.fault = fault;
    return r;
  }
  return state == State::waiting ? uncalm_reason(demand) : WaitReason{};
}

const char* name(Kind kind) noexcept {
  switch (kind) {
    case Kind::none:
      return "none";
    case Kind::no_report:
      return "no_report";
    case Kind::not_homed:
      return "not_homed";
    case Kind::fault:
      return "fault";
    case Kind::proxy_search:
      return "proxy_search";
    case Kind::no_room:
      return "no_room";
    case Kind::handle_moves:
      return "handle_moves";
    case Kind::handle_turns:
      return "handle_turns";
    case Kind::contact_pushes:
      return "contact_pushes";
    case Kind::contact_twists:
      return "contact_twists";
  }
  return "unknown";
}

}  // namespace wrenchd
