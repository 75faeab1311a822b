// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "daemon/control/json_rpc.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd {

// wrenchctl workspace: shows and changes how the handle moves the tool of a running daemon. Not RT-safe: each
// command waits for the daemon.

/// "scale 1, clutch off". workspace: result of workspace.get.
std::string workspace_text(const Json& workspace);

void run_workspace_show(const ControlOptions& options);
/// scale: displacement of the tool divided by displacement of the handle.
void run_workspace_scale(double scale, const ControlOptions& options);
/// on: true disconnects the tool from the handle.
void run_workspace_clutch(bool on, const ControlOptions& options);
/// Moves the tool to the pose of the handle.
void run_workspace_recentre(const ControlOptions& options);

}  // namespace wrenchd
