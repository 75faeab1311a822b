// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/hand_file.hpp"

namespace wrenchd::test_hand_file {

TEST_CASE("a file of the second hand has its name before the extension", "[hand_file]") {
  CHECK(file_of_hand("/run/wrenchd/control.sock", "left") == "/run/wrenchd/control-left.sock");
  CHECK(file_of_hand("run.h5", "left") == "run-left.h5");
  CHECK(file_of_hand("a.b/run", "left") == "a.b/run-left");
}

TEST_CASE("files of the first hand keep their names", "[hand_file]") {
  CHECK(file_of_hand("/run/wrenchd/control.sock", "") == "/run/wrenchd/control.sock");
  CHECK(file_of_hand("", "left").empty());
}

}  // namespace wrenchd::test_hand_file
