// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <string>

#include <catch2/catch.hpp>

#include "daemon/guide_line.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_guide_line {

namespace {

namespace fs = std::filesystem;
using Catch::EndsWith;

TEST_CASE("the help names the guides and references that are installed", "[guide_line]") {
  const test::TemporaryDirectory directory;
  const fs::path share = directory.path() / "share", source = directory.path() / "source";
  const fs::path installed = share / "doc/wrenchd" / "README.md";
  const fs::path references = share / "doc/wrenchd-doc/reference/index.html";
  CHECK(guide_line(share, {}).empty());
  CHECK(guide_line(share, source).empty());
  directory.write(fs::path("source") / "README.md", "text");
  CHECK(guide_line(share, source) == "Guides: " + (source / "README.md").string());
  directory.write(references, "text");
  CHECK(guide_line(share, {}) == "References: " + references.string());
  directory.write(installed, "text");
  CHECK(guide_line(share, source) ==
        "Guides: " + installed.string() + "; references: " + references.string());
  fs::remove(references);
  CHECK(guide_line(share, source) == "Guides: " + installed.string());
}

TEST_CASE("the help of a program in the build tree ends with the README of the source tree", "[guide_line]") {
  for (const char* program : {"wrenchd", "wrenchctl"}) {
    INFO(program);
    CHECK_THAT(test::run_program(program, {"--help"}).out,
               EndsWith("\nGuides: " + test::source_path("README.md") + "\n"));
  }
}

}  // namespace
}  // namespace wrenchd::test_guide_line
