// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/live_workspace.hpp"

#include <spdlog/fmt/fmt.h>

#include "config/toml_file.hpp"
#include "tools/daemon_call.hpp"

namespace wrenchd {
namespace {

/// The words of `wrenchctl workspace` that set this value.
std::string command_for(const Json& workspace, const std::string& key) {
  if (key == "scale") return "scale " + to_text(workspace["scale"].get<double>());
  return std::string("clutch ") + (workspace["clutched"] == true ? "on" : "off");
}

void change(const std::string& key, const Json& value, const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json before = call(client, "workspace.get");
  const Json now = call(client, "workspace.set", {{key, value}});
  if (options.json) return print(pretty(now));
  print(command_for(before, key) + " -> " + command_for(now, key) + "\n");
  if (before[key] != now[key]) print("undo: wrenchctl workspace " + command_for(before, key) + "\n");
}

}  // namespace

std::string workspace_text(const Json& workspace) {
  return fmt::format("scale   {:g}: the tool moves {:g} mm per mm of the handle\nclutch  {}\n",
                     workspace["scale"].get<double>(), workspace["scale"].get<double>(),
                     workspace["clutched"] == true ? "on: the tool stays in place, without contact force"
                                                   : "off: the tool follows the handle");
}

void run_workspace_show(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json workspace = call(client, "workspace.get");
  print(options.json ? pretty(workspace) : workspace_text(workspace));
}

void run_workspace_scale(double scale, const ControlOptions& options) {
  change("scale", scale, options);
}

void run_workspace_clutch(bool on, const ControlOptions& options) {
  change("clutched", on, options);
}

void run_workspace_recentre(const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json now = call(client, "workspace.set", {{"recentre", true}});
  print(options.json ? pretty(now) : "requested: the tool moves to the pose of the handle\n");
}

}  // namespace wrenchd
