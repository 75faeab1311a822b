// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/new_scene.hpp"

namespace wrenchd {
namespace {

class NewCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* command =
        app.add_subcommand("new",
                           "Make a scene of your own: a directory with scene, configuration and\n"
                           "hand script that arm and touch at once");
    command->add_option("name", directory_, "directory to make")->required()->check(not_empty());
    command->add_option("--tool", tool_, "OFF, OBJ, STL or PLY file of the tool in the hand")
        ->required()
        ->check(not_empty());
    command->add_option("--obstacle", obstacle_, "mesh file that the tool is lowered onto; default: a table")
        ->check(not_empty());
    scale_option_ =
        command
            ->add_option("--scale", scale_,
                         "metres per mesh unit; default: 0.001 if the tool is larger than 2 units, else 1")
            ->check(number_in_range(1e-9, 1e6));
    command->callback([this] {
      MeshLoader loader = make_mesh_loader();
      NewScene request;
      request.directory = directory_;
      request.tool = tool_;
      request.obstacle = obstacle_;
      if (!scale_option_->empty()) request.scale = scale_;
      std::fputs(make_new_scene(request, loader).c_str(), stdout);
    });
  }

 private:
  std::string directory_, tool_, obstacle_;
  double scale_ = 1.0;
  CLI::Option* scale_option_ = nullptr;
};

}  // namespace

std::unique_ptr<Subcommand> make_new_command() {
  return std::make_unique<NewCommand>();
}

}  // namespace wrenchd
