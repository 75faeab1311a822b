// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "tools/marker_columns.hpp"

namespace wrenchd::test_marker_columns {

TEST_CASE("conditions hold until a marker changes them", "[export]") {
  Recording recording;
  const auto add = [&](std::int64_t time_ns, const std::string& label, const std::string& conditions) {
    RecordedEvent event;
    event.time_ns = time_ns, event.name = "marker", event.text = label, event.conditions = conditions;
    recording.events.push_back(event);
  };
  CHECK(MarkerColumns(recording).empty());
  add(20, "b", R"({"load":1})");  // markers of several clients may be stored in another order
  add(10, "a", R"({"stiffness":2000,"surface":"rubber"})");
  add(30, "c", "");
  const MarkerColumns markers(recording);
  CHECK(markers.conditions() == std::vector<std::string>{"stiffness", "surface", "load"});
  CHECK(markers.at(9) == nullptr);
  CHECK(markers.at(10)->label == "a");
  CHECK(markers.at(19)->values == std::vector<Json>{2000, "rubber", nullptr});
  CHECK(markers.at(20)->values == std::vector<Json>{2000, "rubber", 1});
  CHECK(markers.at(1000)->label == "c");
  CHECK(markers.at(1000)->values == std::vector<Json>{2000, "rubber", 1});
  add(40, "d", "[1]");
  CHECK_THROWS_WITH(MarkerColumns(recording), Catch::Contains("the marker 'd' are not a JSON object"));
}

}  // namespace wrenchd::test_marker_columns
