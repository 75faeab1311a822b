// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/near_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_near_file {

namespace {

using test::TemporaryDirectory;

TEST_CASE("a mistyped file name has the nearest file of its directory", "[near_file]") {
  const TemporaryDirectory dir;
  const auto cube = dir.write("meshes/cube.off", "");
  const auto post = dir.write("meshes/post.off", "");
  const auto meshes = dir.path() / "meshes";
  CHECK(near_file(meshes / "cub.off") == cube);
  CHECK(near_file(meshes / "cbue.off") == cube);
  CHECK(near_file(meshes / "Post.OFF") == post);
  CHECK(near_file(meshes / "gear.off").empty());
}

TEST_CASE("a file with another extension, or without one, is near", "[near_file]") {
  const TemporaryDirectory dir;
  const auto cube = dir.write("cube.off", "");
  CHECK(near_file(dir.path() / "cube.stl") == cube);
  CHECK(near_file(dir.path() / "cube") == cube);
}

TEST_CASE("a mistyped directory is replaced too", "[near_file]") {
  const TemporaryDirectory dir;
  const auto cube = dir.write("meshes/parts/cube.off", "");
  CHECK(near_file(dir.path() / "mehses/parts/cube.off") == cube);
  CHECK(near_file(dir.path() / "mesh/part/cub.off") == cube);
  CHECK(near_file(dir.path() / "scenes/parts/cube.off").empty());
}

TEST_CASE("names without a file have no near file", "[near_file]") {
  const TemporaryDirectory dir;
  CHECK(near_file("").empty());
  CHECK(near_file("/").empty());
  CHECK(near_file(dir.path() / "none.toml").empty());
  dir.write("nine.toml/inside.toml", "");  // a directory is no file
  CHECK(near_file(dir.path() / "none.toml").empty());
}

}  // namespace
}  // namespace wrenchd::test_near_file
