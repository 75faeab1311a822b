// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/gallery.hpp"

namespace wrenchd {
namespace {

class GalleryCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* gallery =
        app.add_subcommand("gallery", "List the example scenes, with a description and the command of each");
    gallery->add_option("name", name_, "name of a scene; without it, one line per scene")
        ->check(not_empty("name a scene, or leave it out"));
    gallery->callback([this] {
      std::cout << (name_.empty() ? gallery_text(SearchPath()) : gallery_text(SearchPath(), name_));
    });
  }

 private:
  std::string name_;
};

}  // namespace

std::unique_ptr<Subcommand> make_gallery_command() {
  return std::make_unique<GalleryCommand>();
}

}  // namespace wrenchd
