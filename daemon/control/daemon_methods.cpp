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
#include "daemon/wait_text.hpp"
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

/// The limits that the loop holds now, which a reload may have changed.
Json limits_json(const RunConfig& config, const LimitSettings& limits) {
  const bool watched = !config.profile.has_output || config.profile.watchdog_s > 0.0;
  return {{"max_force_N", limits.max_force_N},
          {"max_torque_Nm", limits.max_torque_Nm},
          {"force_slew_N_per_s", limits.force_slew_N_per_s},
          {"torque_slew_Nm_per_s", limits.torque_slew_Nm_per_s},
          {"soft_start_s", limits.soft_start_s},
          {"authority", watched ? 1.0 : ProfileDevice::kAuthorityWithoutWatchdog}};
}

/// The newest fault that changed the state, and when it was raised on the clock of the ticks.
Json last_fault_json(const FeedSnapshot& now) {
  if (now.last_fault == Fault::none) return nullptr;
  Json fault = fault_json(now.last_fault);
  fault["time_ns"] = now.last_fault_at.time_since_epoch().count();
  return fault;
}

/// The faults shortly before the cause, the newest first.
Json before_cause_json(const FeedSnapshot& now) {
  Json faults = Json::array();
  for (const Fault fault : now.before_cause) faults.push_back(fault_json(fault));
  return faults;
}

/// Why there is no force now, as text; null in states with force.
Json no_force_json(const DaemonContext& context, const FeedSnapshot& now) {
  const WaitReason reason = context.runtime.loop().telemetry().wait_reason();
  std::string text = no_force_text(now.state, now.cause, reason, context.runtime.config().profile);
  if (const std::string obstacle = context.runtime.arming_obstacle();
      now.state == State::disarmed && !obstacle.empty())
    text = "the device cannot be armed: " + obstacle;
  return text.empty() ? Json(nullptr) : Json(text);
}

Json state_json(const DaemonContext& context, const FeedSnapshot& now) {
  const Lease& lease = context.lease;
  Json armed_by = nullptr;
  if (is_armed(now.state))
    armed_by = lease.armed() && lease.holder() ? lease.holder()->identity : "command line";
  return {{"sequence", now.sequence},
          {"state", name(now.state)},
          {"cause", fault_json(now.cause)},
          {"before_cause", before_cause_json(now)},
          {"no_force", no_force_json(context, now)},
          {"last_fault", last_fault_json(now)},
          {"armed_by", armed_by},
          {"lease", lease.holder() ? Json(lease.holder()->identity) : Json(nullptr)},
          {"proxy_initialization", now.proxy_initialization}};
}

/// Returns the status, and subscribes the client to all later events.
MethodResult subscribe(const MethodTable& table, const DaemonContext& context, const Json& params,
                       const Caller& caller) {
  std::set<std::string> names;
  if (const auto events = params.find("events"); events != params.end())
    for (const Json& event : *events) {
      const auto name = event.get<std::string>();
      const auto& known = table.events();
      if (std::none_of(known.begin(), known.end(), [&](const EventRow& row) { return row.name == name; }))
        throw RpcError(RpcCode::invalid_params,
                       "There is no event '" + printable(name) +
                           "'; method 'describe' lists all events. Leave 'events' out to receive all.");
      names.insert(name);
    }
  const Json status = status_json(context);
  *caller.subscription = {true, std::move(names), status["sequence"].get<std::uint64_t>() + 1};
  return status;
}

Lease::Holder as_holder(const Caller& caller) {
  return {caller.client, caller.identity};
}

RpcError lease_held(const Lease& lease, const std::string& advice) {
  const std::string& holder = lease.holder()->identity;
  return {RpcCode::lease_held, "The lease is held by " + holder + advice + ".", {{"holder", holder}}};
}

/// Throws RpcError unless the caller holds the lease.
void check_holder(const Lease& lease, const Caller& caller) {
  if (lease.held_by(caller.client)) return;
  if (lease.holder()) throw lease_held(lease, "");
  throw RpcError(RpcCode::invalid_state,
                 "You do not hold the lease: acquire it with 'lease.acquire', then send 'lease.heartbeat' at "
                 "least every 0.1 s.");
}

MethodResult acquire_lease(const DaemonContext& context, const Json& params, const Caller& caller) {
  Lease& lease = context.lease;
  const auto now = std::chrono::steady_clock::now();
  const bool preempt = params.value("preempt", false);
  if (preempt && caller.role < Role::administrator)
    throw RpcError(RpcCode::permission_denied,
                   "Only administrators may preempt the lease, and you are an " +
                       std::string(name(caller.role)) + "; request it without 'preempt'.",
                   {{"role", name(caller.role)}, {"min_role", name(Role::administrator)}});
  if (lease.holder() && !lease.held_by(caller.client) && !preempt)
    throw lease_held(
        lease, "; wait until the holder releases it, or ask an administrator to acquire it with 'preempt'");
  lease.preempt(as_holder(caller), now);
  return Json{{"heartbeat_timeout_s", seconds(kHeartbeatTimeout)}};
}

/// Throws RpcError if the state machine ignores the trigger in the present state.
void check_state(const ServoLoop& loop, Trigger trigger, const char* action) {
  const State state = loop.telemetry().state();
  const Transition& row = transition(trigger, state);
  if (row.changes_state) return;
  throw RpcError(
      RpcCode::invalid_state,
      "The loop cannot be " + std::string(action) + " in state '" + name(state) + "': " + row.reason + ".",
      {{"state", name(state)}, {"cause", fault_json(loop.telemetry().cause())}});
}

MethodResult arm(const DaemonContext& context, const Caller& caller) {
  check_holder(context.lease, caller);
  check_state(context.runtime.loop(), Trigger::arm, "armed");
  if (const std::string obstacle = context.runtime.arming_obstacle(); !obstacle.empty())
    throw RpcError(RpcCode::invalid_state, "The device cannot be armed: " + obstacle + ".",
                   {{"state", name(context.runtime.loop().telemetry().state())}});
  context.lease.arm(std::chrono::steady_clock::now());
  return Json{{"requested", "arm"}};
}

MethodResult stop(const DaemonContext& context, const Caller& caller) {
  ServoLoop& loop = context.runtime.loop();
  const bool first = loop.telemetry().state() != State::stopped;
  loop.requests().stop();
  if (first)
    context.feed.emit("log", EventLevel::warning, "stop: requested by " + caller.identity,
                      {{"requested_by", caller.identity}});
  return Json{{"requested", "stop"}};
}

MethodResult acknowledge(const DaemonContext& context, const Caller& caller) {
  ServoLoop& loop = context.runtime.loop();
  check_state(loop, Trigger::acknowledge, "acknowledged");
  loop.requests().acknowledge();
  context.feed.emit("log", EventLevel::info, "acknowledged by " + caller.identity,
                    {{"requested_by", caller.identity}});
  return Json{{"requested", "acknowledge"}};
}

MethodResult grasp(const DaemonContext& context) {
  if (context.runtime.reconfigurator().present_scene()->settings.bodies.empty())
    throw RpcError(RpcCode::rejected,
                   "the scene has no free body to hold: give it a [[body]], or load another scene");
  context.runtime.loop().requests().grasp();
  return Json{{"requested", "grasp"}};
}

MethodResult list_devices() {
  const KnownProfiles known = known_profiles(SearchPath());
  const std::vector<UsbDevice> connected = list_usb_devices();
  const DeviceChoice choice = choose_device(connected, known.profiles, {});
  Json list = Json::array();
  for (std::size_t i = 0; i < connected.size(); ++i) {
    const bool selected = choice.selection && choice.selection->device == i;
    list.push_back(
        {{"device", describe(connected[i])},
         {"product", to_printable(connected[i].product_name)},
         {"profile", selected ? Json(known.profiles[choice.selection->profile].name) : Json(nullptr)},
         {"rejection_reason", choice.rejections[i]}});
  }
  return Json{{"devices", list}, {"invalid_profiles", known.rejected}};
}

void add_status_methods(MethodTable& table, const DaemonContext& context) {
  table.add(MethodRow{"describe",
                      Role::observer,
                      {},
                      "Returns version and protocol, each method with its role and parameters, each event, "
                      "each setting with the effect of its reload, and each error.",
                      [&table](const Json&, const Caller&) { return MethodResult(table.describe()); }});
  table.add(
      MethodRow{"status",
                Role::observer,
                {},
                "Returns state and cause, the faults of the ten seconds before the cause, device, limits, "
                "lease, and tick times. The result includes all events up to number 'sequence'.",
                [context](const Json&, const Caller&) { return MethodResult(status_json(context)); }});
  table.add(MethodRow{"devices",
                      Role::observer,
                      {},
                      "Returns the connected devices: the profile of each device, or the reason why it has "
                      "none.",
                      [](const Json&, const Caller&) { return list_devices(); },
                      true});
}

void add_event_methods(MethodTable& table, const DaemonContext& context) {
  for (const EventRow& row : feed_events()) table.add(row);
  table.add(EventRow{"lease", "The holder of the lease changed. holder: identity of the holder, or null."});
  table.add(EventRow{"events_lost",
                     "This client read too slowly. count: number of events of any name that were dropped "
                     "before this one. Each subscriber receives this event, whatever names it chose."});
  table.add(
      MethodRow{"subscribe",
                Role::observer,
                {{"events", ParamType::texts, false, "names of the events to receive; default: all events"}},
                "Returns the status, then sends a notification 'event' for each later event. If the client "
                "receives all events, 'sequence' has no gap.",
                [&table, context](const Json& params, const Caller& caller) {
                  return subscribe(table, context, params, caller);
                }});
  table.add(MethodRow{
      "unsubscribe", Role::observer, {}, "Ends the subscription.", [](const Json&, const Caller& caller) {
        *caller.subscription = {};
        return MethodResult(Json::object());
      }});
}

void add_lease_methods(MethodTable& table, const DaemonContext& context) {
  table.add(MethodRow{
      "lease.acquire",
      Role::operator_,
      {{"preempt", ParamType::boolean, false,
        "administrators only: takes the lease from its holder and disarms what the holder armed"}},
      "Acquires the right to arm, which one client holds at a time. The lease ends if 'lease.heartbeat' does "
      "not arrive within heartbeat_timeout_s, or if the connection ends; then the force fades out.",
      [context](const Json& params, const Caller& caller) {
        return acquire_lease(context, params, caller);
      }});
  table.add(MethodRow{"lease.release",
                      Role::operator_,
                      {},
                      "Releases the lease, and disarms what its holder armed.",
                      [context](const Json&, const Caller& caller) {
                        check_holder(context.lease, caller);
                        context.lease.release("released it");
                        return MethodResult(Json::object());
                      }});
  table.add(MethodRow{"lease.heartbeat",
                      Role::operator_,
                      {},
                      "Keeps the lease. Send it without an id: then there is no reply.",
                      [context](const Json&, const Caller& caller) {
                        check_holder(context.lease, caller);
                        context.lease.heartbeat(std::chrono::steady_clock::now());
                        return MethodResult(Json::object());
                      }});
}

void add_state_machine_methods(MethodTable& table, const DaemonContext& context) {
  table.add(
      MethodRow{"stop",
                Role::observer,
                {},
                "Emergency stop: zero force from the next tick until a client acknowledges. Every client "
                "may stop.",
                [context](const Json&, const Caller& caller) { return stop(context, caller); }});
  table.add(
      MethodRow{"arm",
                Role::operator_,
                {},
                "Requests force; only the holder of the lease may. The force rises when the hand is calm. "
                "Event 'state' or 'arming_rejected' reports the result.",
                [context](const Json&, const Caller& caller) { return arm(context, caller); }});
  table.add(MethodRow{
      "disarm",
      Role::operator_,
      {},
      "The force fades out within 100 ms, no matter which client armed. The lease keeps its holder.",
      [context](const Json&, const Caller&) {
        context.lease.disarm();
        return MethodResult(Json{{"requested", "disarm"}});
      }});
  table.add(MethodRow{"acknowledge",
                      Role::operator_,
                      {},
                      "Confirms that a person has checked the fault or the stop. The self-test runs again; "
                      "afterwards the loop "
                      "is disarmed.",
                      [context](const Json&, const Caller& caller) { return acknowledge(context, caller); }});
  table.add(MethodRow{"reinitialize_proxy",
                      Role::operator_,
                      {},
                      "Searches for a feasible pose of the proxy again. There is no contact force until the "
                      "search succeeds; then a soft start follows.",
                      [context](const Json&, const Caller&) {
                        context.runtime.loop().requests().reinitialize_proxy();
                        return MethodResult(Json{{"requested", "reinitialize_proxy"}});
                      }});
  table.add(MethodRow{
      "grasp",
      Role::operator_,
      {},
      "The tool holds the free body that it touches, or the first one that it will touch, until 'let_go'. "
      "Event 'grasp' reports it. A load larger than the strength of the grasp ends it.",
      [context](const Json&, const Caller&) { return grasp(context); }});
  table.add(MethodRow{
      "let_go",
      Role::operator_,
      {},
      "The tool lets go of the body that it holds. The force of its weight fades out within 150 ms.",
      [context](const Json&, const Caller&) {
        context.runtime.loop().requests().let_go();
        return MethodResult(Json{{"requested", "let_go"}});
      }});
}

/// Returns the name of the body that the tool holds; null if it holds none.
Json held_body(const SceneSettings& scene, std::uint32_t number) {
  if (number == 0 || number > scene.bodies.size()) return nullptr;
  return scene.bodies[number - 1].name;
}

}  // namespace

Json status_json(const DaemonContext& context) {
  const RunConfig& config = context.runtime.config();
  const ServoLoop& loop = context.runtime.loop();
  const LoopTiming& timing = loop.telemetry().timing();
  context.feed.drain();  // the snapshot includes all events up to now
  const FeedSnapshot now = context.feed.snapshot();
  const auto scene = context.runtime.reconfigurator().present_scene();
  Json status = state_json(context, now);
  status.update({{"version", kVersion},
                 {"hand", config.is_second ? Json(config.hand()) : Json(nullptr)},
                 {"tick", timing.tick.count()},
                 {"device",
                  {{"profile", config.profile.name},
                   {"present", now.state != State::disconnected && now.state != State::shutdown},
                   {"simulated", config.simulated}}},
                 {"scene",
                  {{"file", scene->settings.file.string()},
                   {"obstacles", scene->settings.half_spaces.size() + scene->settings.meshes.size()},
                   {"bodies", scene->settings.bodies.size()},
                   {"held_body", held_body(scene->settings, now.held_body)},
                   {"rendering_id", scene->rendering_id}}},
                 {"rates", {{"rate_Hz", config.settings.servo.rate_Hz}}},
                 {"limits", limits_json(config, loop.telemetry().limits())},
                 {"stiffness_scale", now.stiffness_scale},
                 {"timing",
                  {{"tick", times_json(timing.tick)},
                   {"wake_latency", times_json(timing.wake_latency)},
                   {"overruns", timing.overruns.load()},
                   {"skipped_ticks", timing.skipped_ticks.load()}}},
                 {"dropped_events", loop.telemetry().dropped_events()}});
  for (const auto& [name, row] : context.status_sections) status[name] = row();
  return status;
}

void add_daemon_methods(MethodTable& table, const DaemonContext& context) {
  add_status_methods(table, context);
  add_event_methods(table, context);
  add_lease_methods(table, context);
  add_state_machine_methods(table, context);
}

}  // namespace wrenchd
