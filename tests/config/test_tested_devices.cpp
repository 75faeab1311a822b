// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "config/tested_devices.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_tested_devices {

using namespace wrenchd::test;
namespace fs = std::filesystem;

namespace {

const TestedDevice kDevice = {"mine", "A 17/../x", "name = \"mine\"\n"};

fs::path only_file(const fs::path& directory) {
  REQUIRE(std::distance(fs::directory_iterator(directory), fs::directory_iterator()) == 1);
  return fs::directory_iterator(directory)->path();
}

}  // namespace

TEST_CASE("a tested device is remembered with its profile and its serial number", "[tested_devices]") {
  const TemporaryDirectory files;
  const TestedDevices tested(files.path() / "tested");
  CHECK_FALSE(tested.contains(kDevice));
  tested.add(kDevice);
  CHECK(tested.contains(kDevice));
  CHECK(only_file(files.path() / "tested").parent_path() == files.path() / "tested");
  CHECK_FALSE(tested.contains({"mine", "A 18", kDevice.profile_text}));
  CHECK_FALSE(tested.contains({"other", kDevice.serial, kDevice.profile_text}));
  CHECK_FALSE(tested.contains({"mine", kDevice.serial, "name = \"mine\"\nmax_force_N = 5\n"}));
}

TEST_CASE("a damaged, foreign or unreadable file is no passed test", "[tested_devices]") {
  const TemporaryDirectory files;
  const TestedDevices tested(files.path() / "tested");
  tested.add(kDevice);
  const fs::path file = only_file(files.path() / "tested");
  std::ofstream(file, std::ios::app) << " ";
  CHECK_FALSE(tested.contains(kDevice));
  fs::remove(file);
  fs::create_symlink("/dev/null", file);
  CHECK_FALSE(tested.contains(kDevice));
  fs::remove(file);
  fs::create_directory(file);
  CHECK_FALSE(tested.contains(kDevice));
}

TEST_CASE("a device without a serial number is not remembered", "[tested_devices]") {
  const TemporaryDirectory files;
  const TestedDevices tested(files.path());
  CHECK_FALSE(tested.contains({"mine", "", ""}));
  CHECK_THROWS_AS(tested.add({"mine", "", ""}), std::invalid_argument);
}

TEST_CASE("a test that cannot be remembered names the directory", "[tested_devices]") {
  const TemporaryDirectory files;
  const fs::path blocked = files.write("file", "");
  CHECK_THROWS_WITH(TestedDevices(blocked / "tested").add(kDevice),
                    Catch::Matchers::Contains(blocked.string()));
}

}  // namespace wrenchd::test_tested_devices
