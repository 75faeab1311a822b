// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/fault_text.hpp"

namespace wrenchd {
namespace {

class FaultCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* faults =
        app.add_subcommand("faults",
                           "Explain the faults: detection, effect on the force and its timing, reason and\n"
                           "remedy");
    faults->add_option("name", name_, "name of a fault as in the log; without it, all faults")
        ->check(not_empty());
    faults->add_flag("--states", states_, "show the states and their transitions instead");
    faults->callback([this] {
      if (states_)
        std::cout << state_machine_text();
      else
        std::cout << (name_.empty() ? fault_text() : fault_text(name_));
    });
  }

 private:
  std::string name_;
  bool states_ = false;
};

}  // namespace

std::unique_ptr<Subcommand> make_fault_command() {
  return std::make_unique<FaultCommand>();
}

}  // namespace wrenchd
