// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/daemon_methods.hpp"

#include <algorithm>
#include <chrono>
#include <set>

#include "config/config_error.hpp"
#include "config/known_profiles.hpp"
#include "core/limits.hpp"
#include "core/watch_limits.hpp"
#include "daemon/runtime.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "daemon/version.hpp"
#include "devices/discovery/choose_device.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {
namespace {

bool is_armed(State state) {
  return is_driving(state) || state == State::waiting;
}

Json times_json(const DurationHistogram& times) {
  const auto us = [](Duration d) { return 1e-3 * static_cast<double>(d.count()); };
  return {{"p50_us", us(times.quantile(0.5))},
          {"p99_9_us", us(times.quantile(0.999))},
          {"max_us", us(times.max())}};
}

Json limits_json(const RunConfig& plan) {
  const WrenchLimits limits(plan.settings.limits, plan.profile);
  const bool watched = !plan.profile.has_output || plan.profile.watchdog_s > 0.0;
  return {{"max_force_N", limits.max_force_N()},
          {"max_torque_Nm", limits.max_torque_Nm()},
          {"force_slew_N_per_s", plan.settings.limits.force_slew_N_per_s},
          {"torque_slew_Nm_per_s", plan.settings.limits.torque_slew_Nm_per_s},
          {"soft_start_s", plan.settings.limits.soft_start_s},
          {"authority", watched ? 1.0 : ProfileDevice::kAuthorityWithoutWatchdog}};
}

Json state_json(const DaemonContext& parts, const FeedSnapshot& now) {
  const Lease& lease = parts.lease;
  Json armed_by = nullptr;
  if (is_armed(now.state))
    armed_by = lease.armed() && lease.holder() ? lease.holder()->identity : "command line";
  return {{"sequence", now.sequence},
          {"state", name(now.state)},
          {"cause", fault_json(now.cause)},
          {"armed_by", armed_by},
          {"lease", lease.holder() ? Json(lease.holder()->identity) : Json(nullptr)},
          {"placing", now.proxy_initialization}};
}

/// What a client hears first: the status, and all that happens after it.
MethodResult subscribe(const MethodTable& table, const DaemonContext& parts, const Json& params,
                       const Caller& caller) {
  std::set<std::string> names;
  if (const auto events = params.find("events"); events != params.end())
    for (const Json& event : *events) {
      const auto name = event.get<std::string>();
      const auto& known = table.events();
      if (std::none_of(known.begin(), known.end(), [&](const EventRow& row) { return row.name == name; }))
        throw RpcError(RpcCode::invalid_params, "There is no event '" + printable(name) +
                                                    "'; method 'describe' lists them. Leave 'events' out to "
                                                    "hear all.");
      names.insert(name);
    }
  const Json status = status_json(parts);
  *caller.subscription = {true, std::move(names), status["sequence"].get<std::uint64_t>() + 1};
  return status;
}

Lease::Holder as_holder(const Caller& caller) {
  return {caller.client, caller.identity};
}

/// That the caller holds the lease, or why it cannot do what it asks for.
void check_holder(const Lease& lease, const Caller& caller) {
  if (lease.held_by(caller.client)) return;
  if (lease.holder())
    throw RpcError(RpcCode::lease_held, "The lease is held by " + lease.holder()->identity + ".",
                   {{"holder", lease.holder()->identity}});
  throw RpcError(RpcCode::invalid_state,
                 "You do not hold the lease: take it with 'lease.take', and say 'beat' more often than every "
                 "0.1 s from then on.");
}

MethodResult take_lease(const DaemonContext& parts, const Json& params, const Caller& caller) {
  Lease& lease = parts.lease;
  const auto now = std::chrono::steady_clock::now();
  const bool from_other = params.value("from_other", false);
  if (from_other && caller.role < Role::administrator)
    throw RpcError(RpcCode::permission_denied,
                   "Only administrators take the lease from another, and you are an " +
                       std::string(name(caller.role)) + "; ask for it without 'from_other'.",
                   {{"role", name(caller.role)}, {"needs", name(Role::administrator)}});
  if (lease.holder() && !lease.held_by(caller.client) && !from_other)
    throw RpcError(RpcCode::lease_held,
                   "The lease is held by " + lease.holder()->identity +
                       "; wait until it gives it back, or have an administrator take it with 'from_other'.",
                   {{"holder", lease.holder()->identity}});
  lease.preempt(as_holder(caller), now);
  return Json{{"beat_within_s", seconds(kHeartbeatTimeout)}};
}

/// Whether a state allows a request, by the table of the state machine.
void check_state(const ServoLoop& loop, Trigger trigger, const char* what) {
  const State state = loop.telemetry().state();
  const Transition& row = transition(trigger, state);
  if (row.changes_state) return;
  throw RpcError(RpcCode::invalid_state,
                 "It cannot be " + std::string(what) + " in state '" + name(state) + "': " + row.reason + ".",
                 {{"state", name(state)}, {"cause", fault_json(loop.telemetry().cause())}});
}

MethodResult arm(const DaemonContext& parts, const Caller& caller) {
  check_holder(parts.lease, caller);
  check_state(parts.runtime.loop(), Trigger::arm, "armed");
  parts.lease.arm(std::chrono::steady_clock::now());
  return Json{{"asked", "arm"}};
}

MethodResult stop(const DaemonContext& parts, const Caller& caller) {
  ServoLoop& loop = parts.runtime.loop();
  const bool first = loop.telemetry().state() != State::stopped;
  loop.requests().stop();
  if (first)
    parts.feed.emit("log", EventLevel::warning, "stop: asked for by " + caller.identity,
                    {{"by", caller.identity}});
  return Json{{"asked", "stop"}};
}

MethodResult acknowledge(const DaemonContext& parts, const Caller& caller) {
  ServoLoop& loop = parts.runtime.loop();
  check_state(loop, Trigger::acknowledge, "acknowledged");
  loop.requests().acknowledge();
  parts.feed.emit("log", EventLevel::info, "acknowledged by " + caller.identity, {{"by", caller.identity}});
  return Json{{"asked", "acknowledge"}};
}

MethodResult devices() {
  const KnownProfiles known = known_profiles(SearchPath());
  const std::vector<UsbDevice> plugged = list_usb_devices();
  const DeviceChoice choice = choose_device(plugged, known.profiles, {});
  Json list = Json::array();
  for (std::size_t i = 0; i < plugged.size(); ++i) {
    const bool picked = choice.selection && choice.selection->device == i;
    list.push_back(
        {{"device", describe(plugged[i])},
         {"product", to_printable(plugged[i].product_name)},
         {"profile", picked ? Json(known.profiles[choice.selection->profile].name) : Json(nullptr)},
         {"why_not", choice.rejections[i]}});
  }
  return Json{{"devices", list}, {"refused_profiles", known.refused}};
}

}  // namespace

Json status_json(const DaemonContext& parts) {
  const RunConfig& plan = parts.runtime.config();
  const ServoLoop& loop = parts.runtime.loop();
  const LoopTiming& timing = loop.telemetry().timing();
  parts.feed.drain();  // so that it is as of now
  const FeedSnapshot now = parts.feed.snapshot();
  Json status = state_json(parts, now);
  status.update(
      {{"version", kVersion},
       {"tick", timing.tick.count()},
       {"device",
        {{"profile", plan.profile.name},
         {"present", now.state != State::disconnected && now.state != State::shutdown},
         {"simulated", plan.simulated}}},
       {"scene", {{"file", plan.scene.file.string()}, {"obstacles", parts.runtime.scene().obstacle_count()}}},
       {"rates", {{"rate_Hz", plan.settings.servo.rate_Hz}}},
       {"limits", limits_json(plan)},
       {"stiffness_share", now.stiffness_scale},
       {"timing",
        {{"tick", times_json(timing.tick)},
         {"wake_latency", times_json(timing.wake_latency)},
         {"overruns", timing.overruns.load()},
         {"skipped", timing.skipped_ticks.load()}}},
       {"dropped_events", loop.telemetry().dropped_events()}});
  for (const auto& [name, row] : parts.status_sections) status[name] = row();
  return status;
}

void add_daemon_methods(MethodTable& table, const DaemonContext& parts) {
  for (const EventRow& row : feed_events()) table.add(row);
  table.add(EventRow{"lease", "Somebody has the lease now, or nobody. holder: who, or null."});
  table.add(EventRow{"lost",
                     "This client read too slowly. count: how many events before this one are lost, of "
                     "any name. It comes whatever names were asked for."});

  table.add(MethodRow{"describe",
                      Role::observer,
                      {},
                      "Version and protocol, every method with its role and parameters, every event, every "
                      "error.",
                      [&table](const Json&, const Caller&) { return MethodResult(table.describe()); }});
  table.add(
      MethodRow{"status",
                Role::observer,
                {},
                "State and cause, device, limits, lease, and the times that ticks take. It is as of the "
                "event with the number 'sequence'.",
                [parts](const Json&, const Caller&) { return MethodResult(status_json(parts)); }});
  table.add(
      MethodRow{"subscribe",
                Role::observer,
                {{"events", ParamType::texts, false, "names of events to hear of; without it all"}},
                "Answers the status, then sends a notification 'event' for each event after it, without "
                "a gap in 'sequence' where all are asked for.",
                [&table, parts](const Json& params, const Caller& caller) {
                  return subscribe(table, parts, params, caller);
                }});
  table.add(
      MethodRow{"unsubscribe", Role::observer, {}, "No more events.", [](const Json&, const Caller& caller) {
                  *caller.subscription = {};
                  return MethodResult(Json::object());
                }});
  table.add(
      MethodRow{"devices",
                Role::observer,
                {},
                "What is plugged in, the profile each device has, and for the others why they have none.",
                [](const Json&, const Caller&) { return devices(); },
                true});
  table.add(MethodRow{"stop",
                      Role::observer,
                      {},
                      "Emergency stop: no force in the next tick, until somebody acknowledges. Anybody may.",
                      [parts](const Json&, const Caller& caller) { return stop(parts, caller); }});

  table.add(MethodRow{
      "lease.take",
      Role::operator_,
      {{"from_other", ParamType::boolean, false,
        "administrators: whoever has it loses it, and what it armed is disarmed"}},
      "The right to arm, for one at a time. It ends when 'beat' does not come within "
      "beat_within_s, or the connection ends, and the force fades then.",
      [parts](const Json& params, const Caller& caller) { return take_lease(parts, params, caller); }});
  table.add(MethodRow{"lease.give",
                      Role::operator_,
                      {},
                      "Gives the lease back; what it armed is disarmed.",
                      [parts](const Json&, const Caller& caller) {
                        check_holder(parts.lease, caller);
                        parts.lease.release("gave it back");
                        return MethodResult(Json::object());
                      }});
  table.add(MethodRow{"beat",
                      Role::operator_,
                      {},
                      "Its holder's sign of life. Send it without an id, so that nothing is answered.",
                      [parts](const Json&, const Caller& caller) {
                        check_holder(parts.lease, caller);
                        parts.lease.heartbeat(std::chrono::steady_clock::now());
                        return MethodResult(Json::object());
                      }});
  table.add(
      MethodRow{"arm",
                Role::operator_,
                {},
                "The holder of the lease asks for force. It comes when the hand is calm: events 'state' "
                "tell, or 'refused'.",
                [parts](const Json&, const Caller& caller) { return arm(parts, caller); }});
  table.add(MethodRow{"disarm",
                      Role::operator_,
                      {},
                      "The force fades within 100 ms, whoever armed. The lease stays where it is.",
                      [parts](const Json&, const Caller&) {
                        parts.runtime.loop().requests().disarm();
                        return MethodResult(Json{{"asked", "disarm"}});
                      }});
  table.add(MethodRow{"acknowledge",
                      Role::operator_,
                      {},
                      "Somebody has looked at the fault, or the stop: the device is tested anew, and is "
                      "disarmed.",
                      [parts](const Json&, const Caller& caller) { return acknowledge(parts, caller); }});
  table.add(MethodRow{"start_over",
                      Role::operator_,
                      {},
                      "The place of the tool is looked for anew; there is no force until it is found, and a "
                      "soft start.",
                      [parts](const Json&, const Caller&) {
                        parts.runtime.loop().requests().reinitialize_proxy();
                        return MethodResult(Json{{"asked", "start_over"}});
                      }});
}

}  // namespace wrenchd
