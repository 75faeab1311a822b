// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <iostream>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/paper_figures.hpp"
#include "tools/paper_tables.hpp"

namespace wrenchd {
namespace {

class PaperCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* paper =
        app.add_subcommand("paper",
                           "Compare wrenchd with the examples in Kolesnikov and Zefran's paper, and draw\n"
                           "its Figs. 11 to 15");
    paper->add_option("-o,--output", directory_, "directory for the figures (PNG) and their data (CSV)")
        ->check(not_empty())
        ->capture_default_str();
    paper->callback([this] {
      std::cout << paper_tables() << std::flush;
      write_paper_figures(directory_);
      std::cout << "\nFigs. 11 to 15 (fig11.png, fig11.csv, ...) are in " << directory_.string() << '\n';
    });
  }

 private:
  std::filesystem::path directory_ = "wrenchd-paper";
};

}  // namespace

std::unique_ptr<Subcommand> make_paper_command() {
  return std::make_unique<PaperCommand>();
}

}  // namespace wrenchd
