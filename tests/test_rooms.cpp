// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"

namespace wrenchd::test_rooms {

// The rooms of the source tree, as the README draws them: dependencies point one way.

namespace {

namespace fs = std::filesystem;

const std::map<std::string, std::set<std::string>> kMayInclude = {
    {"core", {"core"}},
    {"devices", {"devices", "core"}},
    {"collision", {"collision", "core"}},
    {"config", {"config", "core"}},
    {"daemon", {"daemon", "devices", "collision", "config", "core"}},
    {"tools", {"tools", "daemon", "devices", "collision", "config", "core"}},
};

struct Include {
  fs::path file;
  std::string name;
};

std::vector<Include> includes_of(const std::string& room) {
  std::vector<Include> found;
  const std::regex line(R"re(^\s*#include\s+["<]([^">]+)[">])re");
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(wrenchd::test::source_path()) / room)) {
    const std::string extension = entry.path().extension();
    if (extension != ".hpp" && extension != ".cpp") continue;
    std::ifstream in(entry.path());
    std::smatch match;
    for (std::string text; std::getline(in, text);)
      if (std::regex_search(text, match, line)) found.push_back({entry.path(), match[1]});
  }
  return found;
}

/// Returns the functions of a source's anonymous namespace. clang-format puts their names at the left border.
std::set<std::string> private_functions(const fs::path& source) {
  const std::regex function(
      R"re(^(?!struct|class|enum|using|static_assert|template)[A-Za-z\[][^;=(]*\b(\w+)\()re");
  std::set<std::string> names;
  std::ifstream in(source);
  std::smatch match;
  bool is_private = false;
  for (std::string line; std::getline(in, line);) {
    if (line == "namespace {") is_private = true;
    if (line.rfind("}  // namespace", 0) == 0) is_private = false;
    if (is_private && std::regex_search(line, match, function)) names.insert(match[1]);
  }
  return names;
}

}  // namespace

TEST_CASE("a room includes only the rooms it may know", "[rooms]") {
  for (const auto& [room, allowed] : kMayInclude) {
    const auto includes = includes_of(room);
    REQUIRE(includes.size() > 5);
    for (const Include& include : includes) {
      const std::string other = include.name.substr(0, include.name.find('/'));
      if (kMayInclude.count(other) == 0) continue;
      INFO(include.file << " includes " << include.name);
      CHECK(allowed.count(other) == 1);
    }
  }
}

TEST_CASE("core knows Eigen and the standard library only", "[rooms]") {
  for (const Include& include : includes_of("core")) {
    INFO(include.file << " includes " << include.name);
    // core/files opens files for all rooms, and is a library of its own.
    if (include.file.parent_path().filename() == "files") continue;
    CHECK_FALSE(include.name.starts_with("core/files/"));
    const bool ours = include.name.starts_with("core/");
    const bool eigen = include.name.starts_with("Eigen/");
    const bool standard =
        include.name.find('/') == std::string::npos && include.name.find('.') == std::string::npos;
    CHECK((ours || eigen || standard));
  }
}

// Builds from nothing compile tests in groups, in which names of two files must not clash.
TEST_CASE("a file of tests has a namespace of its name, and no code outside of it", "[rooms]") {
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(test::source_path()) / "tests")) {
    const std::string stem = entry.path().stem();
    if (!stem.starts_with("test_") || entry.path().extension() != ".cpp") continue;
    ++files;
    INFO(entry.path());
    std::ifstream in(entry.path());
    const std::string opening = "namespace wrenchd::" + stem + " {";
    const std::string closing = "}  // namespace wrenchd::" + stem;
    bool inside = false, closed = false;
    for (std::string line; std::getline(in, line);) {
      const bool code = !line.empty() && !line.starts_with("#include ") && !line.starts_with("//");
      if (line == opening) inside = true;
      if (code && !inside) FAIL_CHECK("before the namespace: " << line);
      if (code && closed) FAIL_CHECK("after the namespace: " << line);
      if (line == closing) closed = true;
    }
    CHECK(closed);
  }
  CHECK(files > 200);
}

// Sources are compiled in groups (WRENCHD_UNITY). If two of a group had functions of one name, a call could
// mean the function of the other source, whose parameters fit better.
TEST_CASE("private functions of a library have names of their own", "[rooms]") {
  const fs::path root = wrenchd::test::source_path();
  std::map<std::string, std::map<std::string, std::string>> sources_of;  // by library and function
  std::size_t functions = 0;
  for (const auto& [room, allowed] : kMayInclude)
    for (const auto& entry : fs::recursive_directory_iterator(root / room)) {
      if (entry.path().extension() != ".cpp") continue;
      const fs::path source = fs::relative(entry.path(), root);
      // A folder of tools/ is a library, and so is the folder of the servo loop.
      const fs::path folder = source.parent_path();
      const std::string library = room == "tools" || folder == "daemon/servo" ? folder.string() : room;
      for (const std::string& name : private_functions(entry.path())) {
        const auto [at, is_new] = sources_of[library].emplace(name, source.string());
        INFO(name << "() is in " << at->second << " and in " << source.string());
        CHECK(is_new);
        ++functions;
      }
    }
  CHECK(functions > 500);
}

TEST_CASE("the firmware reference includes only the integer headers of C99", "[rooms]") {
  for (const char* file : {"wrench_firmware.h", "wrench_firmware.c"}) {
    std::ifstream in(fs::path(wrenchd::test::source_path("devices/firmware")) / file);
    REQUIRE(in);
    const std::regex line(R"re(^\s*#include\s+["<]([^">]+)[">])re");
    std::smatch match;
    for (std::string text; std::getline(in, text);) {
      if (!std::regex_search(text, match, line)) continue;
      INFO(file << " includes " << match[1]);
      const std::set<std::string> allowed = {"stdbool.h", "stddef.h", "stdint.h", "wrench_firmware.h"};
      CHECK(allowed.count(match[1]) == 1);
    }
  }
}

TEST_CASE("headers do not include CGAL, hidapi, toml++ or HDF5", "[rooms]") {
  for (const auto& [room, allowed] : kMayInclude)
    for (const Include& include : includes_of(room)) {
      if (include.file.extension() != ".hpp") continue;
      INFO(include.file << " includes " << include.name);
      for (const char* heavy : {"CGAL/", "hidapi", "libusb", "toml++", "hdf5", "spdlog"})
        CHECK(include.name.find(heavy) == std::string::npos);
    }
}

TEST_CASE("code of the servo thread includes no header that allocates, locks or writes", "[rooms]") {
  const std::vector<std::string> forbidden = {
      "nlohmann/",          "spdlog/", "fmt/",    "filesystem", "hdf5",    "H5",
      "iostream",           "fstream", "sstream", "ostream",    "istream", "mutex",
      "condition_variable", "future",  "CGAL/",   "toml++/"};
  std::size_t files = 0;
  for (const Include& include : includes_of("daemon")) {
    if (include.file.parent_path().filename() != "servo") continue;
    ++files;
    INFO(include.file << " includes " << include.name);
    for (const std::string& name : forbidden) CHECK_FALSE(include.name.starts_with(name));
    // The rest of the daemon may know the servo loop, and never the other way round.
    if (include.name.starts_with("daemon/")) CHECK(include.name.starts_with("daemon/servo/"));
  }
  REQUIRE(files > 100);
}

}  // namespace wrenchd::test_rooms
