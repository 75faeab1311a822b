// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/known_profiles.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_known_profiles {

namespace {

using namespace test;

const std::filesystem::path kConfig = test::source_path("config");

TEST_CASE("every shipped profile is listed under the name of its file", "[known_profiles]") {
  const SearchPath shipped({kConfig});
  const KnownProfiles known = known_profiles(shipped);
  CHECK(known.rejected.empty());
  CHECK(known.profiles.size() == profile_files(shipped).size());
  REQUIRE(known.profiles.size() > 2);
  CHECK(known.profiles[0].name == "example");
  CHECK(known.profiles[1].name == "falcon");
  CHECK(known.files[1].filename() == "falcon.toml");
}

TEST_CASE("rejected profiles are reported and do not affect others", "[known_profiles]") {
  const TemporaryDirectory dir;
  dir.write("profiles/aaa.toml", "inherits = \"falcon\"\nname = \"mine\"\n");
  dir.write("profiles/bbb.toml", "name = \"no end\n");
  dir.write("profiles/ccc.toml", "inherits = \"falcon\"\nname = \"typo\"\nreport_rate_hz = 1000.0\n");
  const KnownProfiles known = known_profiles(SearchPath({dir.path(), kConfig}));
  CHECK(known.profiles.size() == profile_files(SearchPath({kConfig})).size() + 1);
  CHECK(known.profiles[0].name == "mine");
  REQUIRE(known.rejected.size() == 2);
  CHECK_THAT(known.rejected[0], Catch::Contains("profiles/bbb.toml:1:"));
  CHECK_THAT(known.rejected[1],
             Catch::Contains("profiles/ccc.toml:3:1: ") && Catch::Contains("did you mean 'report_rate_Hz'"));
}

TEST_CASE("the administrator's profile overrides the shipped profile of its name, even if it is rejected",
          "[known_profiles]") {
  const TemporaryDirectory dir;
  dir.write("profiles/falcon.toml", "name = 3\n");
  const KnownProfiles known = known_profiles(SearchPath({dir.path(), kConfig}));
  CHECK(known.rejected.size() == 1);
  for (const DeviceProfile& profile : known.profiles) CHECK(profile.name != "falcon");
}

TEST_CASE("without profile files the list is empty", "[known_profiles]") {
  const TemporaryDirectory dir;
  const KnownProfiles known = known_profiles(SearchPath({dir.path(), "/nowhere"}));
  CHECK(known.profiles.empty());
  CHECK(known.rejected.empty());
}

}  // namespace
}  // namespace wrenchd::test_known_profiles
