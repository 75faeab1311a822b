// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/guide_line.hpp"
#include "daemon/standard_streams.hpp"
#include "daemon/version.hpp"
#include "tools/commands/subcommand.hpp"

namespace {

using namespace wrenchd;

/// All commands in the order of the help.
std::vector<std::unique_ptr<Subcommand>> make_commands() {
  std::vector<std::unique_ptr<Subcommand>> commands;
  for (const auto make : {make_solve_command, make_check_command, make_report_commands, make_device_commands,
                          make_doctor_command, make_daemon_commands, make_set_command, make_scene_command,
                          make_workspace_command, make_view_command, make_fault_command, make_mesh_command,
                          make_import_command, make_gallery_command, make_new_command, make_paper_command,
                          make_recording_commands, make_sweep_command, make_names_command})
    commands.push_back(make());
  return commands;
}

/// Names of the subcommands that the help shows.
std::string subcommand_names(const CLI::App& app) {
  std::string names;
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty()) names += (names.empty() ? "" : ", ") + command->get_name();
  return names;
}

int exit_code_of(const std::vector<std::unique_ptr<Subcommand>>& commands) {
  for (const auto& command : commands)
    if (command->exit_code() != kExitDone) return command->exit_code();
  return kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  if (!open_standard_streams()) return 1;  // else a file that is opened gets the number of a closed stream
  CLI::App app("wrenchctl: controls wrenchd, checks its input files, and computes projections and wrenches.");
  app.set_version_flag("--version", std::string("wrenchctl ") + kVersion);
  app.footer(with_guide_line(
      "Commands for a running daemon use the socket of --socket; without it, the first of $WRENCHD_SOCKET,\n"
      "/run/wrenchd/control.sock and $XDG_RUNTIME_DIR/wrenchd/control.sock.\n"
      "Exit codes: 0 done; 1 rejected (standard error names the file, the location and the remedy);\n"
      "2 mesh: not a solid; 3 solve: no admissible pose was found near a pose; 4 replay: a tick differs;\n"
      "5 doctor, conform: a check failed; over 100: invalid command line."));
  app.require_subcommand(0, 1);  // optional, so that an unknown command appears by name in the error
  const auto commands = make_commands();
  for (const auto& command : commands) command->add_to(app);
  advise_on_mistakes(app);
  try {
    app.parse(argc, argv);
    if (app.get_subcommands().empty())
      throw CLI::RequiredError("A subcommand (" + subcommand_names(app) + ")");
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      throw std::runtime_error("standard output: cannot be written; check whether the disk is full");
    return exit_code_of(commands);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    print_note(error.what() + file_advice(error.what(), argc, argv));
    return kExitRejected;
  }
}
