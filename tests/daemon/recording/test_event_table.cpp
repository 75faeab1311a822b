// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>

#include <catch2/catch.hpp>
#include <hdf5.h>

#include "daemon/recording/event_table.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_event_table {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

RecordedEvent event(std::int64_t time_ns, const std::string& name, const std::string& text) {
  RecordedEvent made;
  made.time_ns = time_ns;
  made.tick = time_ns / 1'000'000;
  made.name = name;
  made.text = text;
  return made;
}

}  // namespace

TEST_CASE("events read back as they were written, in one piece or many", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  std::vector<RecordedEvent> events;
  for (int i = 0; i < 100; ++i)
    events.push_back(event(i * 7'000'000, "state", "state: " + std::to_string(i)));
  events[3].severity = EventLevel::error;
  events[3].value = 0.1;
  events[4].name = "marker";
  events[4].conditions = R"({"stiffness":2000})";
  {
    RecordingWriter writer(file, {});
    writer.append_events({});
    writer.append_events(std::span(events).first(1));
    writer.append_events(std::span(events).subspan(1));
  }
  const std::vector<RecordedEvent> read = read_recording(file).events;
  REQUIRE(read.size() == events.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    CHECK(read[i].time_ns == events[i].time_ns);
    CHECK(read[i].tick == events[i].tick);
    CHECK(read[i].severity == events[i].severity);
    CHECK(read[i].name == events[i].name);
    CHECK(read[i].text == events[i].text);
    CHECK(read[i].conditions == events[i].conditions);
    CHECK((i == 3 ? read[i].value == 0.1 : std::isnan(read[i].value)));
  }
}

TEST_CASE("texts are cut between two characters, and conditions are not cut", "[recording]") {
  CHECK(cut_text("abc", 3) == "abc");
  CHECK(cut_text("abc", 2) == "ab");
  CHECK(cut_text("a\xc3\xa4z", 2) == "a");
  CHECK(cut_text("a\xe2\x82\xac", 3) == "a");
  CHECK(cut_text("\xe2\x82\xac", 2).empty());
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  std::array events = {event(1, "a name that is far longer than the column", std::string(600, 'x'))};
  events[0].conditions = "{\"x\":\"" + std::string(RecordedEvent::kConditionsBytes, 'y') + "\"}";
  { RecordingWriter(file, {}).append_events(events); }
  const auto read = read_recording(file).events;
  REQUIRE(read.size() == 1);
  CHECK(read[0].name == "a name that is far longer than t");
  CHECK(read[0].text == std::string(RecordedEvent::kTextBytes, 'x'));
  CHECK(read[0].conditions.empty());
}

TEST_CASE("a recording without its events is rejected, and unfinished rows of events are dropped",
          "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  const std::array events = {event(1, "state", "state: active")};
  { RecordingWriter(file, {}).append_events(events); }
  {
    const H5Handle opened(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    const H5Handle set(H5Dopen2(opened, "/events", H5P_DEFAULT), H5Dclose);
    const hsize_t rows = 9;
    H5Dset_extent(set, &rows);
  }
  CHECK(read_recording(file).events.size() == 1);
  {
    const H5Handle opened(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    H5Ldelete(opened, "/events", H5P_DEFAULT);
  }
  CHECK_THROWS_WITH(read_recording(file), Contains("has no table 'events'; name a recording of wrenchd"));
}

}  // namespace wrenchd::test_event_table
