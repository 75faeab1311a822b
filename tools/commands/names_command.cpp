// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/daemon_command.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/completion_names.hpp"

namespace wrenchd {
namespace {

/// The shell completion runs this command; the help does not show it.
class NamesCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* names = app.add_subcommand("names", "Print names for the shell completion, one a line");
    names->group("");
    add_daemon_options(*names, options_);
    names->add_option("kind", kind_, "kind of the names")->required()->check(one_of(completion_kinds()));
    names->add_option("name", name_, "for values: the setting");
    names->callback([this] {
      for (const std::string& name : completion_names(kind_, name_, SearchPath(), options_))
        std::printf("%s\n", name.c_str());
    });
  }

 private:
  ControlOptions options_;
  std::string kind_, name_;
};

}  // namespace

std::unique_ptr<Subcommand> make_names_command() {
  return std::make_unique<NamesCommand>();
}

}  // namespace wrenchd
