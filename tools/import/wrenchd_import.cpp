// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/standard_streams.hpp"
#include "daemon/version.hpp"
#include "tools/import/import_options.hpp"
#include "tools/import/import_run.hpp"

int main(int argc, char** argv) {
  using namespace wrenchd;
  if (!open_standard_streams()) return 1;  // else a file that is opened gets the number of a closed stream
  CLI::App app(
      "wrenchd-import: converts CAD files, common meshes and robots to meshes and scenes of wrenchd.\n"
      "wrenchctl import is the same command.");
  app.set_version_flag("--version", std::string("wrenchd-import ") + kVersion);
  app.footer(
      "Exit codes: 0 done; 1 rejected (standard error names the file, the location and the remedy);\n"
      "over 100: invalid command line.");
  ImportOptions options;
  add_import_options(app, options);
  advise_on_mistakes(app);
  try {
    app.parse(argc, argv);
    run_import(options);
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      throw std::runtime_error("standard output: cannot be written; check whether the disk is full");
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wrenchd-import: %s\n", error.what());
    return 1;
  }
}
