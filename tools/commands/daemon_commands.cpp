// SPDX-License-Identifier: GPL-3.0-or-later
#include <utility>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/daemon_command.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd {
namespace {

/// The commands for a running daemon, except view.
class DaemonCommands final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    add(app, "status", "Show state, cause and remedy, device, limits, lease and tick durations",
        [this] { run_status(options_); });
    add(app, "watch", "Show the status, then every event until Ctrl-C", [this] {
      run_watch(options_);
    })->add_option("events", options_.events, "event names; without them, all (wrenchctl describe)");
    add(app, "arm", "Acquire the lease and arm; Ctrl-C or the end of this program disarms", [this] {
      exit_code_ = run_arm(options_);
    })->add_flag("--preempt", options_.preempt, "administrators: take the lease from its present holder");
    add(app, "describe", "List the methods with their roles, and the events", [this] {
      run_describe(options_);
    })->add_option("method", options_.method, "name of a method; without it, all methods");
    add_record(app);
    add(app, "grasp", "Hold the free body that the tool touches, or the first one that it will touch",
        [this] { run_request("grasp", options_); });
    add(app, "let-go", "Let go of the body that the tool holds", [this] { run_request("let_go", options_); });
    for (const auto& [name, description] :
         {std::pair{"disarm", "Fade the force out, no matter which client armed"},
          std::pair{"stop", "Emergency stop; requires no lease"},
          std::pair{"acknowledge", "Clear a latched fault or stop after an inspection"},
          std::pair{"reload", "Load the configuration again"}})
      add(app, name, description, [this, name = name] { run_request(name, options_); });
  }

 private:
  template <class Run>
  CLI::App* add(CLI::App& app, const char* name, const char* description, Run run) {
    CLI::App* command = add_daemon_command(app, name, description, options_);
    command->callback([run] { run(); });
    return command;
  }

  void add_record(CLI::App& app) {
    CLI::App* record = add(app, "record",
                           "Start or stop a recording of every tick, show its progress, set markers in it,\n"
                           "list recordings and copy them",
                           [this] { run_record(options_); });
    record->add_option("what", options_.method, "start, stop, mark, status, list or get")
        ->required()
        ->check(one_of({"start", "stop", "mark", "status", "list", "get"}));
    record
        ->add_option(
            "file", options_.file,
            "for start: a name in the daemon's recording directory, or for administrators a path;\n"
            "without it, a name from the time. For mark: the label of the marker. For get: a name in\n"
            "the list")
        ->check(not_empty());
    record
        ->add_option(
            "--set", options_.conditions,
            "for mark: a condition NAME=VALUE, a number or a text, which holds until the next marker\n"
            "changes it; repeatable")
        ->check(not_empty());
    record
        ->add_option("-o,--output", options_.output,
                     "for get: file to write; without it, the same name in the current directory")
        ->check(not_empty());
  }

  ControlOptions options_;
};

}  // namespace

std::unique_ptr<Subcommand> make_daemon_commands() {
  return std::make_unique<DaemonCommands>();
}

}  // namespace wrenchd
