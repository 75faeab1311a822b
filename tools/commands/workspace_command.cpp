// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/daemon_command.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/live_workspace.hpp"

namespace wrenchd {
namespace {

/// workspace clutch, scale and recentre.
class WorkspaceCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* workspace = add_daemon_command(
        app, "workspace", "Show how the handle moves the tool, or change it while the daemon runs", options_);
    workspace->require_subcommand(0, 1);
    workspace->callback([this, workspace] {
      if (workspace->get_subcommands().empty()) run_workspace_show(options_);
    });
    CLI::App* clutch = add_daemon_command(
        *workspace, "clutch",
        "on: the tool stays in place without contact force while the handle moves; off: it follows",
        options_);
    clutch->add_option("state", state_, "on or off")->required()->check(one_of({"on", "off"}));
    clutch->callback([this] { run_workspace_clutch(state_ == "on", options_); });
    CLI::App* scale =
        add_daemon_command(*workspace, "scale", "Set how far the tool moves when the handle moves", options_);
    scale
        ->add_option("factor", scale_,
                     "displacement of the tool divided by displacement of the handle, 0.1 to 10")
        ->required();
    scale->callback([this] { run_workspace_scale(scale_, options_); });
    add_daemon_command(*workspace, "recentre", "Move the tool to the pose of the handle", options_)
        ->callback([this] { run_workspace_recentre(options_); });
  }

 private:
  ControlOptions options_;
  std::string state_;
  double scale_ = 1.0;
};

}  // namespace

std::unique_ptr<Subcommand> make_workspace_command() {
  return std::make_unique<WorkspaceCommand>();
}

}  // namespace wrenchd
