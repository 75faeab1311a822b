// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/config_error.hpp"
#include "config/search_path.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_search_path {

using test::TemporaryDirectory;

TEST_CASE("the first directory that has the file is used", "[search_path]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc", dir.path() / "usr"});
  const auto package = dir.write("usr/scenes/a.toml", "");
  CHECK(search.find("scenes/a.toml") == package);
  const auto administrator = dir.write("etc/scenes/a.toml", "");
  CHECK(search.find("scenes/a.toml") == administrator);
}

TEST_CASE("a name inside a file is searched beside that file first", "[search_path]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc"});
  dir.write("etc/a.toml", "");
  const auto beside = dir.write("home/a.toml", "");
  CHECK(search.find("a.toml", dir.path() / "home/wrenchd.toml") == beside);
  CHECK(search.find("a.toml", dir.path() / "elsewhere/wrenchd.toml") == dir.path() / "etc/a.toml");
}

TEST_CASE("an absolute name selects that file only", "[search_path]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc"});
  dir.write("etc/a.toml", "");
  CHECK_FALSE(search.find(dir.path() / "a.toml"));
  CHECK(search.find(dir.path() / "etc/a.toml"));
}

TEST_CASE("a missing file is reported with all searched directories", "[search_path]") {
  const SearchPath search({"/nowhere/etc", "/nowhere/usr"});
  CHECK_THROWS_AS(search.require("wrenchd.toml"), ConfigError);
  CHECK_THROWS_WITH(
      search.require("wrenchd.toml"),
      "wrenchd.toml: no such file; searched /nowhere/etc/wrenchd.toml, /nowhere/usr/wrenchd.toml");
}

TEST_CASE("a missing file is reported with a file of a similar name", "[search_path]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc", dir.path() / "usr"});
  dir.write("usr/profiles/polhem.toml", "");
  const auto scene = dir.write("usr/scenes/cube.toml", "");
  CHECK_THROWS_WITH(search.require("scenes/cueb.toml"),
                    Catch::Contains("did you mean '" + scene.string() + "'?"));
  // A profile is named as on the command line.
  CHECK_THROWS_WITH(search.require(profile_file("polhm")), Catch::Contains("; did you mean 'polhem'?"));
  CHECK(search.searched("scenes/cueb.toml").find("did you mean") == std::string::npos);
  CHECK(search.advice("scenes/gear.toml") == "");
}

TEST_CASE("the default directories contain the shipped files", "[search_path]") {
  CHECK(SearchPath().find("wrenchd.toml"));
  CHECK(SearchPath().candidates("x").front() == "/etc/wrenchd/x");
}

TEST_CASE("a profile is named with or without the extension of its file", "[search_path]") {
  CHECK(profile_file("loopback") == "profiles/loopback.toml");
  CHECK(profile_file("mine/device.toml") == "mine/device.toml");
}

}  // namespace wrenchd::test_search_path
