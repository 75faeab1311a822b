// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/inherited_toml.hpp"
#include "config/load_profile.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_inherited_toml {

using Catch::Contains;
using test::TemporaryDirectory;

namespace {

const std::string kLoopback = test::source_path("config/profiles/loopback.toml");

std::string inheriting(const std::string& parent, const std::string& more = "") {
  return "inherits = \"" + parent + "\"\n" + more;
}

std::string rejection_text(const std::filesystem::path& file, const SearchPath& search) {
  try {
    load_profile(file, search);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a profile overrides its parent key by key", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc", test::source_path("config")});
  const auto file =
      dir.write("etc/profiles/mine.toml", inheriting("loopback",
                                                     "name = 'mine'\n[limits]\nmax_force_N = 3.0\n"
                                                     "[pose_report]\nbuttons = { type = 'u16', byte = 60 }\n"
                                                     "acknowledged = 'none'\n"));
  const DeviceProfile parent = load_profile(kLoopback, search);
  const DeviceProfile mine = load_profile(file, search);
  CHECK(mine.name == "mine");
  CHECK(mine.max_force_N == 3.0);
  CHECK(mine.max_torque_Nm == parent.max_torque_Nm);
  CHECK(mine.pose_report.buttons.bits == 16);
  CHECK_FALSE(mine.pose_report.acknowledged.present);
  CHECK(mine.pose_report.position.byte == parent.pose_report.position.byte);
  CHECK(mine.wrench_report.length == parent.wrench_report.length);
}

TEST_CASE("in a chain of parents the nearest value applies", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path(), test::source_path("config")});
  dir.write("profiles/a.toml",
            inheriting("loopback", "name = 'a'\ndescription = 'of a'\nwatchdog_s = 0.02\n"));
  dir.write("profiles/b.toml", inheriting("a", "name = 'b'\nwatchdog_s = 0.03\n"));
  const DeviceProfile c = load_profile(dir.write("profiles/c.toml", inheriting("b", "name = 'c'\n")), search);
  CHECK(c.name == "c");
  CHECK(c.description == "of a");
  CHECK(c.watchdog_s == 0.03);
}

TEST_CASE("the administrator's file may inherit the package's file of the same name", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path() / "etc", test::source_path("config")});
  const auto file =
      dir.write("etc/profiles/loopback.toml", inheriting("loopback", "[limits]\nmax_force_N = 1.0\n"));
  CHECK(load_profile(file, search).max_force_N == 1.0);
  CHECK(load_profile(file, search).name == "loopback");
  const auto files = profile_files(search);
  CHECK(std::count(files.begin(), files.end(), file) == 1);
  CHECK(std::count(files.begin(), files.end(), kLoopback) == 0);
}

TEST_CASE("profiles that inherit each other are rejected with the whole chain", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path()});
  dir.write("profiles/a.toml", inheriting("b"));
  const auto b = dir.write("profiles/b.toml", inheriting("a"));
  CHECK_THAT(rejection_text(dir.path() / "profiles/a.toml", search),
             Contains(b.string() +
                      ":1:12: key 'inherits': the profiles inherit each other (a.toml -> b.toml -> a)"));
  const auto self = dir.write("profiles/self.toml", inheriting("self"));
  CHECK_THAT(rejection_text(self, search), Contains("self.toml:1:12: ") && Contains("must not inherit"));
}

TEST_CASE("a missing or unnamed parent is rejected", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path()});
  const auto file = dir.write("profiles/a.toml", "\n" + inheriting("missing"));
  CHECK_THAT(rejection_text(file, search),
             Contains("a.toml:2:12: key 'inherits': no profile of this name; searched ") &&
                 Contains("profiles/missing.toml"));
  CHECK_THAT(rejection_text(dir.write("profiles/a.toml", "inherits = 3\n"), search),
             Contains("a.toml:1:12: key 'inherits': expected the name of a profile"));
  CHECK_THAT(rejection_text(dir.write("profiles/a.toml", "inherits = \"\"\n"), search), Contains(":1:12: "));
}

TEST_CASE("defects of a parent are reported with their location in the parent", "[inherited_toml]") {
  const TemporaryDirectory dir;
  const SearchPath search({dir.path(), test::source_path("config")});
  const auto parent = dir.write("profiles/a.toml", inheriting("loopback", "name = 'a'\nwatchdog_s = 7\n"));
  const auto child = dir.write("profiles/b.toml", inheriting("a", "name = ''\n"));
  const std::string message = rejection_text(child, search);
  CHECK_THAT(message, Contains(child.string() + ":2:8: key 'name'"));
  CHECK_THAT(message, Contains(parent.string() + ":3:14: key 'watchdog_s'"));
  CHECK(message.find(child.string()) < message.find(parent.string()));
}

}  // namespace wrenchd::test_inherited_toml
