// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/recording/marker.hpp"

namespace wrenchd::test_marker {

using Catch::Matchers::Contains;

TEST_CASE("a marker has a label of one line, and conditions that are numbers or texts", "[marker]") {
  CHECK_NOTHROW(check_marker("trial 3", Json::object()));
  CHECK_NOTHROW(check_marker("trial 3 – weich", {{"stiffness", 2000}, {"surface", "rubber"}, {"_x2", -0.5}}));
  CHECK_NOTHROW(check_marker(std::string(kMarkerLabelBytes, 'x'), Json::object()));
  for (const std::string& label :
       {std::string(), std::string(kMarkerLabelBytes + 1, 'x'), std::string("two\nlines")})
    CHECK_THROWS_WITH(check_marker(label, Json::object()), Contains("one line of 1 to 120 bytes"));
  for (const std::string name : {"", "2x", "with space", "umlaut_\xc3\xa4", "x.y"})
    CHECK_THROWS_WITH(check_marker("m", {{name, 1}}), Contains("letters, digits and underscores"));
  CHECK_THROWS_WITH(check_marker("m", {{std::string(kConditionNameBytes + 1, 'x'), 1}}),
                    Contains("at most 32"));
  for (const Json& value : {Json(true), Json(nullptr), Json::array({1}), Json::object()})
    CHECK_THROWS_WITH(check_marker("m", {{"x", value}}), Contains("'x' is neither a number nor a text"));
  CHECK_THROWS_WITH(check_marker("m", {{"x", std::string(kConditionTextBytes + 1, 'y')}}),
                    Contains("at most 64"));
  Json many = Json::object();
  for (std::size_t i = 0; i <= kMarkerConditions; ++i) many["x" + std::to_string(i)] = 1;
  CHECK_THROWS_WITH(check_marker("m", many), Contains("at most 16 conditions"));
  Json large = Json::object();  // sixteen names and texts, each within its bounds, that are escaped in JSON
  for (std::size_t i = 0; i < kMarkerConditions; ++i) large["x" + std::to_string(i)] = std::string(60, '"');
  CHECK_THROWS_WITH(check_marker("m", large), Contains("at most 1024 bytes as JSON"));
}

TEST_CASE("markers are limited to a burst, and to a rate over time", "[marker]") {
  MarkerRate rate;
  const auto admitted = [&rate](double from_s, double to_s, int attempts) {
    int count = 0;
    for (int i = 0; i < attempts; ++i)
      count += rate.admit(TimePoint(from_seconds(from_s + (to_s - from_s) * i / attempts))) ? 1 : 0;
    return count;
  };
  CHECK(admitted(100.0, 100.0, 1000) == 50);
  const int in_ten_seconds = admitted(100.0, 110.0, 10'000);
  CHECK(in_ten_seconds >= 199);
  CHECK(in_ten_seconds <= 200);
  CHECK(admitted(1000.0, 1000.0, 1000) == 50);
  CHECK(admitted(900.0, 900.0, 10) == 0);  // a clock that goes back gives no credit
}

}  // namespace wrenchd::test_marker
