// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>

#include <catch2/catch.hpp>

#include "config/rendering_values.hpp"
#include "config/setting_table.hpp"

namespace wrenchd::test_rendering_values {

namespace {

const RenderingValue& value_named(const std::string& name) {
  const auto values = rendering_values();
  const auto found =
      std::find_if(values.begin(), values.end(), [&](const auto& v) { return v.name == name; });
  REQUIRE(found != values.end());
  return *found;
}

TEST_CASE("every setting that a rendering can change has a value", "[rendering_values]") {
  for (const Setting& setting : setting_table()) {
    if (setting.section != "wrench" && !setting.section.starts_with("rendering")) continue;
    INFO(setting.name());
    const auto values = rendering_values();
    CHECK(std::any_of(values.begin(), values.end(), [&](const RenderingValue& value) {
      return value.name == setting.name() || value.name.starts_with(setting.name() + ".");
    }));
  }
}

TEST_CASE("every value states what the loader accepts", "[rendering_values]") {
  for (const RenderingValue& value : rendering_values()) {
    INFO(value.name);
    CHECK(expected_text(value) != "");
  }
  CHECK(expected_text(value_named("wrench.integral_limit_N")) == "a number from 0 to 100 N");
  CHECK(expected_text(value_named("wrench.stiffness.linear_N_per_m")) == "a number from 0 to 100000 N/m");
  CHECK(expected_text(value_named("rendering.planes")) == "a whole number from 1 to 1000");
  CHECK(accepted_words(value_named("wrench.law")) == std::vector<std::string>{"pid", "energy"});
  CHECK(accepted_words(value_named("rendering.method")) ==
        std::vector<std::string>{"exact", "planar", "descent", "translational"});
  CHECK(accepted_words(value_named("rendering.planes")).empty());
}

TEST_CASE("a value has the word or the number of the settings", "[rendering_values]") {
  Settings settings;
  settings.rendering.method = Method::descent;
  settings.wrench.gains.damping = WrenchGains::blockwise(3.0, 0.5);
  CHECK(std::get<std::string>(value_named("rendering.method").read(settings)) == "descent");
  CHECK(std::get<double>(value_named("wrench.damping.linear_N_s_per_m").read(settings)) == 3.0);
  CHECK(std::get<double>(value_named("wrench.damping.angular_Nm_s_per_rad").read(settings)) == 0.5);
  CHECK(value_named("wrench.damping.angular_Nm_s_per_rad").unit() == "N.m.s/rad");
  settings.wrench.gains.damping(0, 1) = settings.wrench.gains.damping(1, 0) = 0.1;
  CHECK(std::holds_alternative<Matrix6d>(value_named("wrench.damping.linear_N_s_per_m").read(settings)));
}

TEST_CASE("a value that the law does not use says so", "[rendering_values]") {
  Settings settings;
  settings.wrench.law = SpringLaw::energy;
  CHECK(value_named("wrench.stiffness.linear_N_per_m").unused_reason(settings) ==
        "only wrench.law pid uses it");
  CHECK(value_named("wrench.energy_stiffness_per_s2").unused_reason(settings) == "");
  settings.wrench.law = SpringLaw::pid;
  CHECK(value_named("wrench.stiffness.linear_N_per_m").unused_reason(settings) == "");
  CHECK(value_named("wrench.energy_stiffness_per_s2").unused_reason(settings) ==
        "only wrench.law energy uses it");
}

TEST_CASE("changed values are those that differ", "[rendering_values]") {
  Settings before, now;
  CHECK(changed_values(before, now).empty());
  now.wrench.law = SpringLaw::pid;
  now.wrench.gains.stiffness = WrenchGains::blockwise(2000.0, 1.5);
  const auto changed = changed_values(before, now);
  REQUIRE(changed.size() == 2);
  CHECK(changed[0].value->name == "wrench.law");
  CHECK(changed[1].value->name == "wrench.stiffness.linear_N_per_m");
  CHECK(std::get<double>(changed[1].before) == 600.0);
  CHECK(std::get<double>(changed[1].now) == 2000.0);
}

}  // namespace
}  // namespace wrenchd::test_rendering_values
