// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/completion_names.hpp"

namespace wrenchd::test_completion_names {

namespace {

std::vector<std::string> names(const std::string& kind, const std::string& name = {}) {
  ControlOptions options;
  options.socket = "none";  // no daemon responds
  return completion_names(kind, name, SearchPath({test::source_path("config")}), options);
}

bool has(const std::vector<std::string>& all, const std::string& name) {
  return std::find(all.begin(), all.end(), name) != all.end();
}

TEST_CASE("the completion knows files, faults, meshes and settings by name", "[completion_names]") {
  CHECK(has(names("gallery"), "peg_in_hole"));
  CHECK(has(names("profiles"), "polhem"));
  CHECK(has(names("scenes"), "cube_on_table"));
  CHECK(has(names("faults"), "tick_late"));
  CHECK(has(names("meshes"), "gear"));
  CHECK(has(names("settings"), "wrench.law"));
  CHECK(names("values", "wrench.law") == std::vector<std::string>{"pid", "energy"});
  CHECK(names("values", "law") == std::vector<std::string>{"pid", "energy"});
  CHECK(names("values", "wrench.integral_limit_N").empty());
}

TEST_CASE("without a daemon the completion offers none of its names", "[completion_names]") {
  for (const char* kind : {"methods", "events", "obstacles"}) CHECK(names(kind).empty());
}

TEST_CASE("every kind of the completion is known, and no other", "[completion_names]") {
  for (const std::string& kind : completion_kinds()) CHECK_NOTHROW(names(kind));
  CHECK_THROWS_WITH(names("profile"), Catch::Contains("did you mean 'profiles'?"));
}

}  // namespace
}  // namespace wrenchd::test_completion_names
