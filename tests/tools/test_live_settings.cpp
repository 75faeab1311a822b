// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "tests/support/rate_check.hpp"
#include "tests/support/running_daemon.hpp"
#include "tools/live_settings.hpp"

namespace wrenchd::test_live_settings {

namespace {

using namespace test;
using Catch::Contains;

Json row(const char* name, const Json& value, const char* unit = "", const char* expected = "a number") {
  return {{"name", name}, {"value", value}, {"unit", unit}, {"expected", expected}};
}

/// Some of the rows of rendering.get.
Json rows() {
  Json law = row("wrench.law", "energy", "", "\"pid\" or \"energy\"");
  law["words"] = {"pid", "energy"};
  return Json::array({row("rendering.planes", 47.0), row("rendering.friction.static", 0.0), law,
                      row("wrench.stiffness.linear_N_per_m", 600.0, "N/m"),
                      row("wrench.stiffness.angular_Nm_per_rad", 1.5, "N.m/rad"),
                      row("wrench.damping.linear_N_s_per_m", 1.0, "N.s/m"),
                      row("wrench.damping.angular_Nm_s_per_rad", 0.002, "N.m.s/rad"),
                      row("wrench.integral_limit_N", 1.0, "N"),
                      row("wrench.integral_limit_Nm", 0.05, "N.m")});
}

Json request(const std::vector<std::string>& words) {
  return rendering_request(assignments_of(words, rows()), rows());
}

std::string found(const std::string& name) {
  std::string names;
  for (const Json& one : find_settings(name, rows()))
    names += (names.empty() ? "" : " ") + one["name"].get<std::string>();
  return names;
}

const std::string kBothStiffnesses = "wrench.stiffness.linear_N_per_m wrench.stiffness.angular_Nm_per_rad";

TEST_CASE("a setting is found without its section and its unit", "[live_settings]") {
  CHECK(found("wrench.stiffness.linear_N_per_m") == "wrench.stiffness.linear_N_per_m");
  CHECK(found("stiffness.angular") == "wrench.stiffness.angular_Nm_per_rad");
  CHECK(found("wrench.stiffness.angular") == "wrench.stiffness.angular_Nm_per_rad");
  CHECK(found("stiffness") == kBothStiffnesses);
  CHECK(found("wrench.stiffness") == kBothStiffnesses);
  CHECK(found("rendering.stiffness") == kBothStiffnesses);  // rendering.set sets it
  CHECK(found("static") == "rendering.friction.static");
  CHECK(found("planes") == "rendering.planes");
  CHECK_THROWS_WITH(found("linear"), Contains("there is no setting 'linear'"));
  CHECK_THROWS_WITH(
      found("integral_limit"),
      Contains("several settings; choose one of wrench.integral_limit_N, wrench.integral_limit_Nm"));
  CHECK_THROWS_WITH(found("stifness"), Contains("there is no setting 'stifness'; did you mean 'stiffness'?"));
  CHECK_THROWS_WITH(found("rendering.plans"), Contains("did you mean 'rendering.planes'?"));
  CHECK_THROWS_WITH(found("bananas"), Contains("wrenchctl set lists all settings"));
}

TEST_CASE("a request has all assignments, and a gain both of its components", "[live_settings]") {
  const Json expected = {
      {"wrench", {{"law", "pid"}, {"stiffness", {{"linear_N_per_m", 2000.0}, {"angular_Nm_per_rad", 1.5}}}}}};
  CHECK(request({"law=pid", "stiffness=2000"}) == expected);
  CHECK(request({"law", "pid", "stiffness", "2000"}) == expected);
  CHECK(request({"law", "pid", "stiffness", "2000", "N/m"}) == expected);
  CHECK(request({"wrench.law=pid", "stiffness=2000 N/m"}) == expected);
  CHECK(request({"law=pid", "stiffness=2e3N/m"}) == expected);
  CHECK(request({"planes=60", "static", "0.4"}) ==
        Json{{"rendering", {{"planes", 60.0}, {"friction", {{"static", 0.4}}}}}});
  CHECK(request({"stiffness.angular=2"})["wrench"]["stiffness"] ==
        Json{{"angular_Nm_per_rad", 2.0}, {"linear_N_per_m", 600.0}});
  CHECK(request({"stiffness=[[1,0],[0,1]]"})["wrench"]["stiffness"] == Json::array({{1, 0}, {0, 1}}));
}

TEST_CASE("a unit selects the component of a gain", "[live_settings]") {
  for (const char* unit : {"N.m/rad", "Nm/rad", "N*m/rad", "Nm_per_rad"}) {
    INFO(unit);
    CHECK(request({"stiffness", "2", unit})["wrench"]["stiffness"] ==
          Json{{"angular_Nm_per_rad", 2.0}, {"linear_N_per_m", 600.0}});
  }
}

TEST_CASE("a wrong value is rejected with the setting and the cure", "[live_settings]") {
  CHECK_THROWS_WITH(request({"stiffness", "2", "kN/m"}),
                    "wrench.stiffness.linear_N_per_m: 'kN/m' is not its unit; give the value in N/m, as in "
                    "wrenchctl set wrench.stiffness.linear_N_per_m=600");
  CHECK_THROWS_WITH(request({"stiffness=2 N/mm"}), Contains("give the value in N/m"));
  CHECK_THROWS_WITH(request({"planes=47 N"}), Contains("it has none"));
  CHECK_THROWS_WITH(request({"stiffness=stiff"}), Contains("expected a number, found 'stiff'"));
  CHECK_THROWS_WITH(request({"stiffness=nan"}), Contains("found 'nan'"));
  CHECK_THROWS_WITH(request({"law=pid", "law=energy"}), Contains("wrench.law: it is assigned twice"));
  CHECK_THROWS_WITH(request({"law=pid", "stiffness"}), Contains("stiffness: a value is missing"));
  CHECK_THROWS_WITH(request({"law="}), Contains("law: a value is missing after '='"));
  CHECK_THROWS_WITH(request({"=3"}), Contains("a name is missing before '='"));
  CHECK_THROWS_WITH(request({"stiffness=[[1,0"}), Contains("is not a matrix"));
}

TEST_CASE("a component of a gain that is a matrix needs the other component", "[live_settings]") {
  Json matrix = rows();
  for (Json& one : matrix)
    if (one["name"].get<std::string>().starts_with("wrench.stiffness")) one["value"] = Json::array({{1.0}});
  CHECK_THROWS_WITH(rendering_request({{"stiffness", "2", ""}}, matrix),
                    Contains("the present gain is a matrix"));
  CHECK_NOTHROW(rendering_request({{"stiffness", "2", ""}, {"stiffness.angular", "1", ""}}, matrix));
}

TEST_CASE("the answer states each change and the command that undoes it", "[live_settings]") {
  const Json changed = Json::array(
      {{{"name", "wrench.law"}, {"unit", ""}, {"before", "energy"}, {"now", "pid"}},
       {{"name", "wrench.stiffness.linear_N_per_m"}, {"unit", "N/m"}, {"before", 600.0}, {"now", 2000.5}}});
  CHECK(changes_text(changed) ==
        "wrench.law: energy -> pid\n"
        "wrench.stiffness.linear_N_per_m: 600 -> 2000.5 N/m\n"
        "undo: wrenchctl set wrench.law=energy wrench.stiffness.linear_N_per_m=600\n");
  CHECK(changes_text(Json::array()) == "nothing changes: the settings have these values already\n");
}

TEST_CASE("the answer states what the stability bound leaves of the stiffness", "[live_settings]") {
  CHECK(scale_text(1.0, 1.0, rows()) == "");
  CHECK_THAT(scale_text(0.5, 1.0, rows()),
             Contains("scales nothing now; it scaled the stiffness to 50 % before"));
  CHECK_THAT(scale_text(1.0, 0.25, rows()), Contains("scales the stiffness to 25 % (before: 100 %)") &&
                                                Contains("wrench.stiffness.linear_N_per_m: 150 of 600 N/m"));
}

TEST_CASE("wrenchctl set shows settings, changes them, and undoes the change", "[live_settings][wall_time]") {
  const MachineLoad load;
  const RunningDaemon daemon;
  REQUIRE_RATE(load, daemon.program.wait_for_output("state: disarmed"));
  const ProgramResult all = daemon.ctl({"set"});
  CHECK(all.exit_code == 0);
  CHECK_THAT(all.out, Contains("wrench.law") && Contains("energy") && Contains("\"pid\" or \"energy\""));
  CHECK_THAT(all.out,
             Contains("600 N/m") && Contains("a number from 0 to 100000 N/m; only wrench.law pid uses it"));
  const std::string both = daemon.ctl({"set", "stiffness"}).out;
  CHECK(std::count(both.begin(), both.end(), '\n') == 2);

  const ProgramResult unused = daemon.ctl({"set", "rendering.stiffness", "2000"});
  CHECK(unused.exit_code == 0);
  CHECK_THAT(unused.out, Contains("wrench.stiffness.linear_N_per_m: 600 -> 2000 N/m\n") &&
                             Contains("undo: wrenchctl set wrench.stiffness.linear_N_per_m=600\n") &&
                             Contains("has no effect now: only wrench.law pid uses it"));

  const ProgramResult scaled = daemon.ctl({"set", "law=pid", "stiffness=90000"});
  CHECK(scaled.exit_code == 0);
  CHECK_THAT(scaled.out, Contains("stability bound: scales the stiffness to ") && Contains(" of 90000 N/m"));
  const double scale = daemon.ask({"status"})["stiffness_scale"];
  CHECK(scale > 0.0);
  CHECK(scale < 0.5);

  const ProgramResult undone =
      daemon.ctl({"set", "wrench.law=energy", "wrench.stiffness.linear_N_per_m=600"});
  CHECK_THAT(undone.out, Contains("wrench.law: pid -> energy"));
  CHECK(daemon.ask({"status"})["stiffness_scale"].get<double>() > scale);
}

TEST_CASE("wrenchctl set applies all changes, or none", "[live_settings]") {
  const MachineLoad load;
  const RunningDaemon daemon;
  REQUIRE_RATE(load, daemon.program.wait_for_output("state: disarmed"));
  const Json before = daemon.ask({"set"})["settings"];
  const auto rejects = [&](std::vector<std::string> words, const std::string& expected) {
    words.insert(words.begin(), "set");
    const ProgramResult result = daemon.ctl(words);
    CHECK(result.exit_code == 1);
    CHECK(result.out == "");
    CHECK_THAT(result.err, Contains(expected));
  };
  rejects({"law=pid", "integral_limit_N=1000"}, "expected a number from 0 to 100 N, found 1000");
  rejects({"planes=60", "law=enrgy"}, "found the text \"enrgy\"; did you mean 'energy'?");
  rejects({"planes=60", "stifness=3"}, "did you mean 'stiffness'?");
  rejects({"method=planar", "static=0.5"}, "exact");
  CHECK(daemon.ask({"set"})["settings"] == before);
}

}  // namespace
}  // namespace wrenchd::test_live_settings
