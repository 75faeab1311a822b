// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/commands/daemon_command.hpp"

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"

namespace wrenchd {

CLI::App* add_daemon_command(CLI::App& app, const std::string& name, const std::string& description,
                             ControlOptions& options) {
  CLI::App* command = app.add_subcommand(name, description);
  command->group(app.get_parent() == nullptr ? kDaemonGroup
                                             : "Subcommands");  // else it inherits the group of its parent
  add_daemon_options(*command, options);
  return command;
}

/// wrenchctl --help lists the sockets that are tried without --socket.
void add_daemon_options(CLI::App& command, ControlOptions& options) {
  command.add_option("--socket", options.socket, "the daemon's control socket (wrenchctl --help)")
      ->check(not_empty());
  command.add_flag("--json", options.json, "print the daemon's response unchanged");
}

}  // namespace wrenchd
