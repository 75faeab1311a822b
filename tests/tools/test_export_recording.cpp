// SPDX-License-Identifier: GPL-3.0-or-later
#include <sstream>

#include <catch2/catch.hpp>

#include "core/state.hpp"
#include "daemon/servo/record_fields.hpp"
#include "tools/export_recording.hpp"

namespace wrenchd::test_export_recording {

using Catch::Matchers::Contains;

namespace {

Recording thousand_ticks() {
  Recording recording;
  for (int i = 0; i < 1000; ++i) {
    TickRecord tick;
    tick.tick = 7 + static_cast<std::uint64_t>(i);
    tick.now_ns = 5'000'000'000 + 1'000'000 * i;
    tick.F_out = {0.1 * i, -0.25, 1.0 / 3.0, 0.0, 1e-9, 2.0};
    tick.state = static_cast<std::uint8_t>(State::active);
    recording.ticks.push_back(tick);
  }
  recording.contact_ranges.resize(1000);
  return recording;
}

std::vector<std::string> lines_of(const ExportSettings& settings) {
  std::ostringstream out;
  write_csv(out, thousand_ticks(), settings);
  std::istringstream in(out.str());
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

}  // namespace

TEST_CASE("columns are exported with their units, and read back with equal values", "[export]") {
  const auto lines = lines_of({.columns = {"F_out", "state", "tick"}});
  REQUIRE(lines.size() == 1001);
  CHECK(lines[0] ==
        "time_s [s],F_out.fx [N],F_out.fy [N],F_out.fz [N],F_out.tx [N.m],F_out.ty [N.m],F_out.tz [N.m],"
        "state [enum],tick [1]");
  CHECK(lines[1] == "0,0,-0.25,0.3333333333333333,0,1e-09,2,active,7");
  CHECK(lines[1000].starts_with("0.999"));
}

TEST_CASE("without column names all columns are exported, each with as many headings as cells", "[export]") {
  const auto lines = lines_of({});
  std::size_t cells = 1;
  for (const RecordField& field : tick_fields()) cells += field.count;
  for (const std::string& line : {lines[0], lines[500]})
    CHECK(static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1 == cells);
  for (const char* heading : {"X_WP.qw [1]", "eps.rx [rad]", "V_BH.wz [rad/s]", "stage_ns.limits [ns]",
                              "energy [kg m^2]", "F_T.ty [N.m]", "X_BH.px [m]"})
    CHECK(lines[0].find(heading) != std::string::npos);
}

TEST_CASE("a part of a recording is exported", "[export]") {
  const auto lines = lines_of({.columns = {"tick"}, .every = 10, .from_s = 0.5, .to_s = 0.6});
  REQUIRE(lines.size() == 12);
  CHECK(lines[1] == "0.5,507");
  CHECK(lines[2].ends_with(",517"));
  CHECK(lines[11].ends_with(",607"));
  CHECK(lines_of({.columns = {"tick"}, .from_s = 2.0}).size() == 1);
}

TEST_CASE("an unknown column is rejected with the most similar name", "[export]") {
  CHECK_THROWS_WITH(lines_of({.columns = {"F_oot"}}), Contains("no column 'F_oot'") && Contains("F_out"));
}

}  // namespace wrenchd::test_export_recording
