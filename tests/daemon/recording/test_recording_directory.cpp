// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <chrono>
#include <cstdlib>
#include <ctime>

#include <catch2/catch.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/recording/recording_directory.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_recording_directory {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

RecordingSettings into(const std::filesystem::path& directory) {
  RecordingSettings settings;
  settings.directory = directory;
  return settings;
}

RecordingSettings keeping_free(double MB) {
  RecordingSettings settings;
  settings.keep_free_MB = MB;
  return settings;
}

}  // namespace

TEST_CASE("a recording is named by a plain name, or by a path if an administrator gives it", "[recording]") {
  const std::filesystem::path there = "/var/lib/wrenchd/recordings";
  CHECK(recording_path("run", there, false) == there / "run.h5");
  CHECK(recording_path("run-2.h5", there, false) == there / "run-2.h5");
  CHECK(recording_path("a.b", there, true) == there / "a.b.h5");
  CHECK(recording_path("/data/x.h5", there, true) == "/data/x.h5");
  for (const char* name :
       {"/data/x.h5", "../x", "a/b", "", ".", "..", ".hidden", "a b", "a\nb", "\xC3\xA4"}) {
    INFO(name);
    CHECK_THROWS_WITH(recording_path(name, there, false), Contains("is not a valid name of a recording") &&
                                                              Contains("only administrators") &&
                                                              Contains(there.string()));
  }
  CHECK_THROWS_WITH(recording_path("../x", there, true), Contains("or use an absolute path"));
  CHECK_THROWS_AS(recording_path(std::string(101, 'a'), there, false), RecordingError);
}

TEST_CASE("only recordings are opened, by their names", "[recording]") {
  const TemporaryDirectory files;
  CHECK(stored_recordings(files.path() / "none").empty());
  files.write("there/b.h5", "of b");
  files.write("there/a.h5", "of a");
  files.write("there/notes.txt", "x");
  files.write("secret.h5", "secret");
  const auto there = files.path() / "there";
  std::filesystem::create_symlink(files.path() / "secret.h5", there / "link.h5");
  std::filesystem::create_directory(there / "directory.h5");
  REQUIRE(::mkfifo((there / "pipe.h5").c_str(), 0600) == 0);
  std::filesystem::last_write_time(there / "b.h5",
                                   std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  const auto found = stored_recordings(there);
  REQUIRE(found.size() == 2);
  CHECK(found[0].name == "b.h5");  // the older one
  CHECK(found[1].name == "a.h5");
  CHECK(found[0].bytes == 4);
  CHECK(std::time(nullptr) - found[0].modified_at >= 3590);
  const OwnedFd open = open_recording(there, "a");
  std::array<char, 8> text{};
  CHECK(::read(open.get(), text.data(), text.size()) == 4);
  CHECK(std::string(text.data()) == "of a");
  CHECK(::write(open.get(), "x", 1) == -1);
  for (const char* name : {"link", "directory", "pipe", "c"})
    CHECK_THROWS_WITH(open_recording(there, name), Contains("there are: b.h5, a.h5"));
  for (const char* name : {"../secret", "/etc/passwd", ""})
    CHECK_THROWS_WITH(open_recording(there, name), Contains("is not a valid name of a recording"));
}

TEST_CASE("recordings are stored in the configured directory, else in the system's state directory",
          "[recording]") {
  const auto before = [](const char* name) {
    const char* value = std::getenv(name);
    return value == nullptr ? std::string() : std::string(value);
  };
  const std::string state = before("STATE_DIRECTORY"), xdg = before("XDG_STATE_HOME"), home = before("HOME");
  setenv("STATE_DIRECTORY", "/var/lib/one:/var/lib/two", 1);
  CHECK(recordings_directory(into("/data")) == "/data");
  CHECK(recordings_directory({}) == "/var/lib/one/recordings");
  unsetenv("STATE_DIRECTORY");
  setenv("XDG_STATE_HOME", "/xdg", 1);
  CHECK(recordings_directory({}) == "/xdg/wrenchd/recordings");
  unsetenv("XDG_STATE_HOME");
  setenv("HOME", "/home/anna", 1);
  CHECK(recordings_directory({}) == "/home/anna/.local/state/wrenchd/recordings");
  unsetenv("HOME");
  CHECK(recordings_directory({}).empty());
  CHECK_THROWS_WITH(make_recordings_directory({}), Contains("set directory in [recording]"));
  for (const auto& [name, value] :
       {std::pair{"STATE_DIRECTORY", state}, {"XDG_STATE_HOME", xdg}, {"HOME", home}})
    if (!value.empty()) setenv(name, value.c_str(), 1);
}

TEST_CASE("the directory of recordings is created, or rejected with a remedy", "[recording]") {
  const TemporaryDirectory files;
  make_recordings_directory(files.path() / "a/b");
  CHECK(std::filesystem::is_directory(files.path() / "a/b"));
  using std::filesystem::perms;
  CHECK(std::filesystem::status(files.path() / "a/b").permissions() ==
        (perms::owner_all | perms::group_read | perms::group_exec));  // nothing for others
  const auto file = files.write("file", "");
  std::filesystem::create_symlink("itself", files.path() / "itself");
  CHECK_THROWS_WITH(make_recordings_directory(files.path() / "itself"),
                    Contains("set directory in [recording]"));
  CHECK_THROWS_WITH(make_recordings_directory(file / "below"),
                    Contains("cannot be created") && Contains("set directory in [recording]"));
}

TEST_CASE("recording requires more free disk space than keep_free_MB", "[recording]") {
  const TemporaryDirectory files;
  const double left_MB = free_MB(files.path());
  CHECK(left_MB > 0.0);
  CHECK_NOTHROW(check_free_space(files.path(), keeping_free(0.0)));
  CHECK_THROWS_WITH(check_free_space(files.path(), keeping_free(2.0 * left_MB)),
                    Contains("MB are free") && Contains("keep_free_MB"));
  CHECK_THROWS_AS(free_MB(files.path() / "none"), RecordingError);
}

TEST_CASE("flight recordings are named by time and fault, and the oldest are removed", "[recording]") {
  const TemporaryDirectory files;
  CHECK(utc_stamp(1795356901) == "20261122T141501Z");
  const auto first = flight_path(files.path(), 1795356901, "overspeed");
  CHECK(first == files.path() / "flight-20261122T141501Z-overspeed.h5");
  files.write(first.filename(), "1");
  CHECK(flight_path(files.path(), 1795356901, "overspeed") ==
        files.path() / "flight-20261122T141501Z-overspeed-2.h5");
  files.write("flight-20261122T141500Z-stop_requested.h5", "2");
  files.write("flight-20261122T141502Z-motors_stalled.h5", "3");
  files.write("run-1.h5", "4");
  files.write("flight-plan.txt", "5");
  prune_flights(files.path(), 2);
  const auto there = [&](const char* name) { return std::filesystem::exists(files.path() / name); };
  CHECK_FALSE(there("flight-20261122T141500Z-stop_requested.h5"));
  CHECK(there("flight-20261122T141501Z-overspeed.h5"));
  CHECK(there("flight-20261122T141502Z-motors_stalled.h5"));
  CHECK(there("run-1.h5"));
  CHECK(there("flight-plan.txt"));
  prune_flights(files.path() / "none", 2);  // a directory that does not exist is no error
}

TEST_CASE("each hand keeps and removes the flights of its own", "[recording]") {
  const TemporaryDirectory files;
  const auto first = flight_path(files.path(), 1'800'000'000, "overspeed");
  const auto left = flight_path(files.path(), 1'800'000'000, "overspeed", "left");
  CHECK(left.filename() == first.stem().string() + "-left.h5");
  files.write(first.filename(), "");
  files.write(left.filename(), "");
  const auto next = flight_path(files.path(), 1'800'000'000, "overspeed", "left");
  CHECK(next.filename() == first.stem().string() + "-2-left.h5");
  CHECK(is_flight_name(left.filename(), "left"));
  CHECK(is_flight_name(next.filename(), "left"));
  CHECK_FALSE(is_flight_name(left.filename()));
  CHECK_FALSE(is_flight_name(left.filename(), "right"));
  CHECK_FALSE(is_flight_name(first.filename(), "left"));
  prune_flights(files.path(), 0, "left");
  CHECK(std::filesystem::exists(first));
  CHECK_FALSE(std::filesystem::exists(left));
}

TEST_CASE("only names that the flight recorder gives are removed as flights", "[recording]") {
  const TemporaryDirectory files;
  for (const char* mine : {"flight-9.h5", "flight-test.h5", "flight-20261122T141501Z.h5",
                           "flight-20261122T141501Z-mine.h5", "flight-20261122T141501Z-overspeed-a.h5"}) {
    CHECK_FALSE(is_flight_name(mine));
    files.write(mine, "mine");
  }
  for (const char* flight :
       {"flight-20261122T141501Z-overspeed.h5", "flight-20261122T141501Z-overspeed-2.h5"}) {
    CHECK(is_flight_name(flight));
    files.write(flight, "flight");
  }
  prune_flights(files.path(), 0);
  std::size_t left = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(files.path())) ++left;
  CHECK(left == 5);
}

}  // namespace wrenchd::test_recording_directory
