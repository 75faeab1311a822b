// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/daemon_command.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/live_settings.hpp"

namespace wrenchd {
namespace {

class SetCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* set = add_daemon_command(
        app, "set", "Show settings of the rendering, or change them while the daemon runs", options_);
    set->add_option("settings", words_,
                    "NAME shows a setting, NAME=VALUE or NAME VALUE changes it; several changes are applied\n"
                    "together, or none if one is rejected. Without a name, all settings are shown")
        ->check(not_empty("name a setting"));
    set->footer(
        "Names are those of wrenchd.toml; the section and the unit may be left out. \"stiffness\" is the\n"
        "translational stiffness; \"stiffness.angular\" is the rotational one. A unit may follow a value.\n"
        "The answer states what held before and what holds now, and the command that undoes the change.\n"
        "Examples:\n"
        "  wrenchctl set                                    all settings with value, unit and range\n"
        "  wrenchctl set law=pid stiffness=2000             two changes at once\n"
        "  wrenchctl set stiffness \"2000 N/m\"");
    set->callback([this] { run_set(words_, options_); });
  }

 private:
  ControlOptions options_;
  std::vector<std::string> words_;
};

}  // namespace

std::unique_ptr<Subcommand> make_set_command() {
  return std::make_unique<SetCommand>();
}

}  // namespace wrenchd
