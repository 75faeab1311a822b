// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <catch2/catch.hpp>

#include "daemon/command_line.hpp"
#include "daemon/option_checks.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_command_line {

namespace {

using Catch::Contains;

/// A program with the commands status, solve and mesh.
struct Program {
  CLI::App app{"", "program"};
  std::string kind, scene;
  int triangles = 0;
  bool json = false;

  Program() {
    app.require_subcommand(0, 1);
    app.add_subcommand("status", "Show state, cause and lease")->add_flag("--json", json);
    CLI::App* mesh = app.add_subcommand("mesh");
    std::vector<std::string>& files = files_;
    CLI::Option* file = mesh->add_option("files", files);
    app.add_subcommand("solve")->add_option("scene", scene);
    mesh->add_option("--make", kind)->check(one_of({"cube", "gear"}))->excludes(file);
    mesh->add_option("--triangles", triangles);
    app.add_subcommand("names")->group("");
  }

  /// Returns the text about an invalid command line; empty: it is valid.
  std::string mistake(std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());  // CLI11 takes the words from the end
    try {
      app.parse(words);
    } catch (const CLI::ParseError& error) {
      return mistake_text(app, error);
    }
    return {};
  }

 private:
  std::vector<std::string> files_;
};

std::string mistake(const std::vector<std::string>& words) {
  return Program().mistake(words);
}

TEST_CASE("a valid command line is no mistake", "[command_line]") {
  CHECK(mistake({"mesh", "--make", "gear", "--triangles", "10"}) == "");
}

TEST_CASE("a mistyped command has the nearest command", "[command_line]") {
  CHECK_THAT(mistake({"stauts"}), Contains("not expected: stauts; did you mean 'status'?"));
  CHECK_THAT(mistake({"mehs", "--make", "gear"}), Contains("not expected: mehs; did you mean 'mesh'?"));
  CHECK_THAT(mistake({"dance"}), Contains("not expected: dance; program --help lists the commands"));
  CHECK_THAT(mistake({"hepl"}), Contains("did you mean '--help'?"));
  CHECK_THAT(mistake({"Lease"}), Contains("--help lists the commands; about it: 'program status'"));
  CHECK_THAT(mistake({"leas\\.*"}), !Contains("about it"));
  CHECK_THAT(mistake({"nams"}), !Contains("did you mean"));  // the help hides it
  CHECK_THAT(mistake({"status", "now"}), Contains("program status --help shows what it accepts"));
}

TEST_CASE("a mistyped option has the nearest option, whatever its value causes", "[command_line]") {
  // 10 would be a file, which --make excludes.
  CHECK_THAT(mistake({"mesh", "--make", "gear", "--trangles", "10"}),
             Contains("not expected: --trangles; did you mean '--triangles'?"));
  CHECK_THAT(mistake({"mesh", "--trangles=10"}), Contains("did you mean '--triangles'?"));
  CHECK_THAT(mistake({"mesh", "-make", "gear"}), Contains("did you mean '--make'?"));
  CHECK_THAT(mistake({"mesh", "--bogus"}), Contains("--bogus; program mesh --help lists the options"));
}

TEST_CASE("an option in the wrong place is sent to its command", "[command_line]") {
  CHECK_THAT(mistake({"--json", "status"}), Contains("--json; it belongs after 'status'"));
  CHECK_THAT(mistake({"mesh", "--jsn"}),
             Contains("'--json' is an option of commands such as 'program status'"));
  CHECK_THAT(mistake({"solve", "--scene", "a.toml"}), Contains("give the scene without '--scene'"));
  CHECK_THAT(mistake({"--json"}), Contains("an option of commands such as 'program status'"));
}

TEST_CASE("a mistyped word of a list has the nearest word", "[command_line]") {
  CHECK_THAT(mistake({"mesh", "--make", "gaer"}),
             Contains("--make: gaer not in {cube,gear}; did you mean 'gear'?"));
  CHECK_THAT(mistake({"mesh", "--make", "teapot"}),
             Contains("teapot not in {cube,gear}") && !Contains("did you mean"));
}

TEST_CASE("a file of the command line that does not exist has the nearest file", "[command_line]") {
  const test::TemporaryDirectory dir;
  const std::string cube = dir.write("cube.off", "").string();
  const std::string typed = (dir.path() / "cub.off").string();
  const char* const arguments[] = {"program", "mesh", typed.c_str()};
  CHECK(file_advice(typed + ": no such file", 3, arguments) == "; did you mean '" + cube + "'?");
  CHECK(file_advice(typed + ": no such file; did you mean 'x'?", 3, arguments) == "");
  CHECK(file_advice("the disk is full", 3, arguments) == "");
  const char* const existing[] = {"program", "mesh", cube.c_str()};
  CHECK(file_advice(cube + ": is not closed", 3, existing) == "");
}

}  // namespace
}  // namespace wrenchd::test_command_line
