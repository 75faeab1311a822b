// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>

#include <catch2/catch.hpp>

#include "core/files/absolute_name.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_absolute_name {

namespace {

namespace fs = std::filesystem;

TEST_CASE("an absolute name has no dots", "[absolute_name]") {
  CHECK(absolute_name("/a/./b/../c") == "/a/c");
  CHECK(absolute_name("x.toml") == fs::current_path() / "x.toml");
}

TEST_CASE("a name stays relative in a working directory that does not exist any more", "[absolute_name]") {
  const fs::path before = fs::current_path();
  {
    const test::TemporaryDirectory files;
    fs::create_directory(files.path() / "gone");
    fs::current_path(files.path() / "gone");
    fs::remove(files.path() / "gone");
    CHECK(absolute_name("./x.toml") == "x.toml");
  }
  fs::current_path(before);
}

}  // namespace
}  // namespace wrenchd::test_absolute_name
