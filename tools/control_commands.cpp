// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/control_commands.hpp"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <spdlog/fmt/fmt.h>
#include <unistd.h>
#include <wrenchd/client.hpp>

#include "config/nearest_key.hpp"
#include "core/files/absolute_name.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/control/owned_fd.hpp"
#include "tools/daemon_call.hpp"
#include "tools/end_signals.hpp"
#include "tools/output_file.hpp"

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// Heartbeat interval: a third of the heartbeat timeout, so that two heartbeats may be late.
constexpr auto kHeartbeatInterval = 30ms;
constexpr auto kFadeTimeout = 2s;

std::string text_or(const Json& value, const char* fallback) {
  return value.is_string() ? value.get<std::string>() : fallback;
}

std::string times(const Json& times) {
  return fmt::format("{:.1f} / {:.1f} / {:.1f} us", times["p50_us"].get<double>(),
                     times["p99_9_us"].get<double>(), times["max_us"].get<double>());
}

void show(const Json& event, const ControlOptions& options) {
  print(options.json ? event.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n' : event_text(event));
}

/// Returns true in states with force, and in states that lead to force.
bool is_armed(const std::string& state) {
  return state == "waiting" || state == "ramping" || state == "active" || state == "degraded";
}

/// Returns the next event; empty if none came in time.
std::optional<Json> next_event(Client& client, std::chrono::milliseconds limit) {
  ClientEvent event;
  if (!client.poll_event(event, limit)) return {};
  return Json::parse(event.json);
}

/// Waits until the daemon reports that the force is zero. The connection may end before.
void wait_for_release(Client& client, const ControlOptions& options, std::string state) {
  const auto end = std::chrono::steady_clock::now() + kFadeTimeout;
  while ((is_armed(state) || state == "releasing") && std::chrono::steady_clock::now() < end) {
    const auto event = next_event(client, kHeartbeatInterval);
    client.heartbeat();
    if (!event) continue;
    show(*event, options);
    if ((*event)["name"] == "state") state = (*event)["state"];
  }
}

}  // namespace

std::string status_text(const Json& s) {
  std::string text = fmt::format("state      {}\n", s["state"].get<std::string>());
  if (const Json& cause = s["cause"]; cause.is_object())
    text += fmt::format("cause      {}: {}\nremedy     {}\n", cause["name"].get<std::string>(),
                        cause["message"].get<std::string>(), cause["cure"].get<std::string>());
  if (const auto before = s.find("before_cause"); before != s.end())
    for (const Json& fault : *before)
      text += fmt::format("before it  {}: {}\n           {}\n", fault["name"].get<std::string>(),
                          fault["message"].get<std::string>(), fault["cure"].get<std::string>());
  if (const auto no_force = s.find("no_force");
      no_force != s.end() && no_force->is_string() && !s["cause"].is_object())
    text += fmt::format("no force   {}\n", no_force->get<std::string>());
  const Json &device = s["device"], &limits = s["limits"], &timing = s["timing"];
  text += fmt::format("device     {}{}, {}\n", text_or(device["profile"], "?"),
                      device["simulated"].get<bool>() ? " (simulated)" : "",
                      device["present"].get<bool>() ? "present" : "absent");
  text +=
      fmt::format("armed by   {}\nlease      {}\n", text_or(s["armed_by"], "-"), text_or(s["lease"], "free"));
  text += fmt::format("limits     {:g} N, {:g} N.m", limits["max_force_N"].get<double>(),
                      limits["max_torque_Nm"].get<double>());
  if (limits["max_force_N"] == 0.0 && limits["max_torque_Nm"] == 0.0)
    text += ": the device has no motors and applies no force";
  else if (const double authority = limits["authority"].get<double>(); authority < 1.0)
    text += fmt::format(", scaled to {:.0f} % because the device has no watchdog", 100.0 * authority);
  text += fmt::format("\nstiffness  {:.0f} % of the configured value\n",
                      100.0 * s["stiffness_scale"].get<double>());
  const Json& scene = s["scene"];
  text += fmt::format("scene      {}, {} obstacles", scene["file"].get<std::string>(),
                      scene["obstacles"].get<std::uint64_t>());
  if (const auto bodies = scene.value("bodies", std::uint64_t{0}); bodies > 0)
    text += fmt::format(", {} free {}", bodies, bodies == 1 ? "body" : "bodies");
  if (const auto held = scene.find("held_body"); held != scene.end() && held->is_string())
    text += fmt::format("; the tool holds '{}'", held->get<std::string>());
  text += '\n';
  text += fmt::format("ticks      {} at {:g} Hz, {} late, {} skipped\n", s["tick"].get<std::uint64_t>(),
                      s["rates"]["rate_Hz"].get<double>(), timing["overruns"].get<std::uint64_t>(),
                      timing["skipped_ticks"].get<std::uint64_t>());
  if (const auto recording = s.find("recording"); recording != s.end()) {
    if (const Json& running = (*recording)["running"]; running.is_object())
      text += fmt::format("recording  {}, {} ticks so far\n", running["file"].get<std::string>(),
                          running["ticks"].get<std::uint64_t>());
    if (const Json& flight = (*recording)["last_flight"]; flight.is_string())
      text += fmt::format("last fault {}\n", flight.get<std::string>());
  }
  return text + fmt::format("duration   {} (p50 / p99.9 / max)\nlatency    {}\n", times(timing["tick"]),
                            times(timing["wake_latency"]));
}

std::string event_text(const Json& event) {
  return fmt::format("{:>14.3f} s  {:<7} {}\n", 1e-9 * event["time_ns"].get<double>(),
                     event["level"].get<std::string>(), event["text"].get<std::string>());
}

void run_status(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json status = call(client, "status");
  print(options.json ? pretty(status)
                     : status_text(status) + "wrenchd    " + status["version"].get<std::string>() + " at " +
                           client.socket() + "\n");
}

void run_watch(const ControlOptions& options) {
  catch_end_signals();
  Client client(options.socket, kResponseTimeout);
  const Json params = options.events.empty() ? Json::object() : Json{{"events", options.events}};
  const Json status = call(client, "subscribe", params);
  print(options.json ? status.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n'
                     : status_text(status));
  while (!end_requested())
    if (const auto event = next_event(client, 200ms)) show(*event, options);
}

int run_arm(const ControlOptions& options) {
  catch_end_signals();
  Client client(options.socket, kResponseTimeout);
  call(client, "subscribe", {{"events", {"state", "fault", "arming_rejected", "lease", "events_lost"}}});
  call(client, "lease.acquire", options.preempt ? Json{{"preempt", true}} : Json::object());
  call(client, "arm");
  std::string state = "waiting";
  while (!end_requested()) {
    client.heartbeat();
    const auto event = next_event(client, kHeartbeatInterval);
    if (!event) continue;
    show(*event, options);
    const auto name = (*event)["name"].get<std::string>();
    if (name == "state") state = (*event)["state"];
    if (name == "arming_rejected" || !is_armed(state)) {
      wait_for_release(client, options, state);
      std::fputs("wrenchctl: the daemon has disarmed; wrenchctl status shows the cause\n", stderr);
      return 1;
    }
  }
  call(client, "disarm");
  wait_for_release(client, options, state);
  call(client, "lease.release");
  return 0;
}

void run_request(const std::string& method, const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json result = call(client, method);
  if (options.json) return print(pretty(result));
  if (!result.contains("requested")) return print(result.empty() ? "done\n" : pretty(result));
  std::this_thread::sleep_for(150ms);  // duration of the fade and a margin for the event
  print(fmt::format("requested: {}; state {}\n", method, call(client, "status")["state"].get<std::string>()));
}

void list_recordings(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json result = call(client, "record.list");
  if (options.json) return print(pretty(result));
  for (const Json& one : result["recordings"])
    print(fmt::format("{:<48} {:>10.1f} MB  {}\n", one["name"].get<std::string>(),
                      1e-6 * one["bytes"].get<double>(), one["modified_utc"].get<std::string>()));
  if (result["recordings"].empty())
    print("no recordings in " + result["directory"].get<std::string>() + "\n");
}

/// The daemon owns its files, so it sends a file descriptor from which this program copies.
void get_recording(const ControlOptions& options) {
  if (options.file.empty())
    throw std::runtime_error("record get: a name is missing; `wrenchctl record list` shows the names");
  Client client(options.socket, kResponseTimeout);
  int received = -1;
  client.call("record.open", Json{{"name", options.file}}.dump(), received);
  const OwnedFd recording(received);
  const std::string name = options.file.ends_with(".h5") ? options.file : options.file + ".h5";
  const std::string output = options.output.empty() ? name : options.output;
  write_output(output, [&recording, &name](std::ostream& out) {
    std::vector<char> piece(1 << 20);
    for (;;) {
      const ssize_t got = ::read(recording.get(), piece.data(), piece.size());
      if (got == 0 || !out) return;
      if (got < 0) throw std::runtime_error(name + ": cannot be read: " + std::strerror(errno));
      out.write(piece.data(), got);
    }
  });
  if (output != "-") print(output + "\n");
}

/// Returns the conditions of NAME=VALUE. A value that is a number becomes one; every other value is a text.
Json conditions_of(const std::vector<std::string>& settings) {
  Json conditions = Json::object();
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0)
      throw std::runtime_error("record mark: --set " + setting +
                               ": expected NAME=VALUE, as in --set stiffness=2000");
    const std::string value = setting.substr(equals + 1);
    double number = 0.0;
    const char* const end = value.data() + value.size();
    const auto parsed = std::from_chars(value.data(), end, number);
    if (parsed.ec == std::errc() && parsed.ptr == end && std::isfinite(number))
      conditions[setting.substr(0, equals)] = number;
    else
      conditions[setting.substr(0, equals)] = value;
  }
  return conditions;
}

void mark_recording(const ControlOptions& options) {
  if (options.file.empty())
    throw std::runtime_error("record mark: a label is missing, as in wrenchctl record mark \"trial 3\"");
  Json params = {{"label", options.file}};
  if (!options.conditions.empty()) params["conditions"] = conditions_of(options.conditions);
  Client client(options.socket, kResponseTimeout);
  const Json result = call(client, "record.mark", params);
  print(options.json ? pretty(result)
                     : fmt::format("marked {} in {}\n", options.file, result["file"].get<std::string>()));
}

void run_record(const ControlOptions& options) {
  if (!options.conditions.empty() && options.method != "mark")
    throw std::runtime_error("record " + options.method + ": accepts no --set; only mark does");
  if (!options.output.empty() && options.method != "get")
    throw std::runtime_error("record " + options.method + ": accepts no -o; only get does");
  if (options.method == "mark") return mark_recording(options);
  if (!options.file.empty() && options.method != "start" && options.method != "get")
    throw std::runtime_error("record " + options.method + ": accepts no file; only start and get do");
  if (options.method == "list") return list_recordings(options);
  if (options.method == "get") return get_recording(options);
  Json params = Json::object();
  if (!options.file.empty()) {  // the user's path is relative to this process, not to the daemon
    const bool is_name = options.file.find('/') == std::string::npos;
    params["file"] = is_name ? options.file : absolute_name(options.file).string();
  }
  Client client(options.socket, kResponseTimeout);
  const Json result = call(client, "record." + options.method, params);
  if (options.json || options.method == "status") return print(pretty(result));
  if (options.method == "start") return print("recording " + result["file"].get<std::string>() + "\n");
  print(fmt::format("recorded {}: {} ticks, {} missing\n", result["file"].get<std::string>(),
                    result["ticks"].get<std::uint64_t>(), result["lost"].get<std::uint64_t>()));
}

void run_describe(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json all = call(client, "describe");
  if (options.json) return print(pretty(all));
  bool found = false;
  for (const Json& method : all["methods"]) {
    if (!options.method.empty() && method["name"] != options.method) continue;
    found = true;
    print(fmt::format("{}  ({})\n  {}\n", method["name"].get<std::string>(),
                      method["min_role"].get<std::string>(), method["doc"].get<std::string>()));
    for (const auto& [name, param] : method["params"].items())
      print(fmt::format("    {}: {}{}; {}\n", name, param["type"].get<std::string>(),
                        param["required"].get<bool>() ? "" : ", optional", param["doc"].get<std::string>()));
  }
  if (!found) {
    std::vector<std::string> names;
    for (const Json& method : all["methods"]) names.push_back(method["name"]);
    const std::string advice = nearest_name_advice(options.method, names);
    throw std::runtime_error(
        "there is no method '" + options.method + "'" +
        (advice.empty() ? "; wrenchctl describe without a name lists the methods" : advice));
  }
  if (!options.method.empty()) return;
  print("\nevents\n");
  for (const Json& event : all["events"])
    print(fmt::format("  {:<10} {}\n", event["name"].get<std::string>(), event["doc"].get<std::string>()));
  print("\nroles\n");
  for (const auto& [role, who] : all["roles"].items())
    print(fmt::format("  {:<14} {}\n", role, who.get<std::string>()));
}

}  // namespace wrenchd
