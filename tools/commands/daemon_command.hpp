// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/control_commands.hpp"

namespace CLI {
class App;
}

namespace wrenchd {

/// Adds a subcommand for a running daemon with the options that all of them share: --socket and --json.
CLI::App* add_daemon_command(CLI::App& app, const std::string& name, const std::string& description,
                             ControlOptions& options);

/// Adds the options that add_daemon_command() adds to a command.
void add_daemon_options(CLI::App& command, ControlOptions& options);

}  // namespace wrenchd
