// SPDX-License-Identifier: GPL-3.0-or-later
#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/view/view.hpp"

namespace wrenchd {
namespace {

class ViewCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* view =
        app.add_subcommand("view",
                           "Serve a page to browsers on this machine that shows scene, contacts\n"
                           "and wrench of a running daemon, or of a recording");
    view->group(kDaemonGroup);
    CLI::Option* const recording = view->add_option("recording", options_.recording,
                                                    "HDF5 file of wrenchd --record; without it, the daemon")
                                       ->check(not_empty());
    view->add_option(
            "--compare", options_.compared,
            "second recording: its curves are dashed, its tool is a ghost, on the time axis of the first")
        ->needs(recording)
        ->check(not_empty());
    view->add_option("--port", options_.port, "port on 127.0.0.1; 0: a free port")->capture_default_str();
    view->add_option("--socket", options_.socket, "the daemon's control socket; default as for status")
        ->check(not_empty());
    view->add_flag("--open", options_.open_browser, "open the page in a browser with xdg-open");
    view->footer(
        "Prints the address, which contains a token; only the complete address works. The page can arm with\n"
        "the rights of the user who runs this command, while the page is open and visible. The emergency\n"
        "stop requires no lease.");
    view->callback([this] { run_view(options_); });
  }

 private:
  ViewOptions options_;
};

}  // namespace

std::unique_ptr<Subcommand> make_view_command() {
  return std::make_unique<ViewCommand>();
}

}  // namespace wrenchd
