// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <iostream>

#include <CLI/CLI.hpp>

#include "collision/meshes/mesh_loader.hpp"
#include "daemon/option_checks.hpp"
#include "tools/check.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/descriptor_source.hpp"

namespace wrenchd {
namespace {

class CheckCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* check =
        app.add_subcommand("check",
                           "Check a configuration, scene, profile or hand script, and the files\n"
                           "that it refers to");
    check->add_option("file", file_, "TOML file; its keys determine its type")
        ->required()
        ->check(not_empty());
    check
        ->add_option("--against", device_,
                     "for a profile: /dev/hidrawN, or a file with the report descriptor to compare\n"
                     "it with")
        ->check(not_empty());
    check->callback([this] { run(); });
  }

 private:
  void run() {
    MeshLoader meshes = make_mesh_loader();
    std::cout << check_file(file_, meshes);
    if (!device_.empty()) std::cout << check_against_descriptor(file_, read_descriptor_source(device_));
  }

  std::filesystem::path file_, device_;
};

}  // namespace

std::unique_ptr<Subcommand> make_check_command() {
  return std::make_unique<CheckCommand>();
}

}  // namespace wrenchd
