// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>

#include <catch2/catch.hpp>

#include "config/nearest_key.hpp"

namespace wrenchd::test_nearest_key {

namespace {

KnownKey key(const std::string& name) {
  return {name, std::string(unit_of(name))};
}

const std::vector<KnownKey> kKeys = {key("rate_Hz"),
                                     key("max_force_N"),
                                     key("max_torque_Nm"),
                                     key("position_m"),
                                     key("rotation_vector_rad"),
                                     key("viscous_friction_N_s_per_m"),
                                     key("viscous_friction_Nm_s_per_rad"),
                                     key("planes"),
                                     {"mass", "kg"}};

std::string advice(std::string_view unknown) {
  return nearest_key(unknown, kKeys).advice;
}

}  // namespace

TEST_CASE("a key name ends in its unit", "[nearest_key]") {
  CHECK(unit_of("max_force_N") == "N");
  CHECK(unit_of("linear_Nm_s_per_rad") == "Nm_s_per_rad");
  CHECK(unit_of("handle_inertia_kg_m2") == "kg_m2");
  CHECK(unit_of("planes").empty());
  CHECK(unit_of("m").empty());
  CHECK(unit_of("").empty());
  CHECK(unit_of("_").empty());
}

TEST_CASE("a unit is printed in the usual notation", "[nearest_key]") {
  CHECK(readable_unit("Hz") == "Hz");
  CHECK(readable_unit("N_s_per_m") == "N.s/m");
  CHECK(readable_unit("Nm_per_rad_s") == "N.m/rad/s");
  CHECK(readable_unit("per_s2") == "1/s2");
  CHECK(readable_unit("kg_m2") == "kg.m2");
  CHECK(readable_unit("").empty());
}

TEST_CASE("a known quantity in another unit is rejected with the correct unit", "[nearest_key]") {
  CHECK(advice("max_force_mN") == "give it in N as 'max_force_N'");
  CHECK(advice("rate_kHz") == "give it in Hz as 'rate_Hz'");
  CHECK(advice("position_mm") == "give it in m as 'position_m'");
  CHECK(advice("rotation_vector_deg") == "give it in rad as 'rotation_vector_rad'");
  CHECK(advice("max_force") == "give it in N as 'max_force_N'");
  CHECK(advice("mass_g") == "give it in kg as 'mass'");
  CHECK(advice("viscous_friction_N_s_per_mm") == "give it in N.s/m as 'viscous_friction_N_s_per_m'");
}

TEST_CASE("a misspelt key is rejected with the nearest key", "[nearest_key]") {
  CHECK(advice("rate_hz") == "did you mean 'rate_Hz'?");
  CHECK(advice("plane") == "did you mean 'planes'?");
  CHECK(advice("max_forc_N") == "did you mean 'max_force_N'?");
}

TEST_CASE("a key that resembles no other is rejected with the list of keys", "[nearest_key]") {
  CHECK(advice("bananas").find("known keys here: 'rate_Hz', 'max_force_N'") == 0);
  CHECK(advice(std::string(1'000'000, 'x')).find("known keys here: ") == 0);
  CHECK(nearest_key("bananas", {}).advice == "no key is known here");
}

TEST_CASE("a mistyped name has the nearest name, upper and lower case alike", "[nearest_key]") {
  const std::vector<std::string> commands = {"status", "arm", "stop", "gear", "acknowledge", "energy"};
  for (const auto& [typed, meant] :
       std::vector<std::pair<std::string, std::string>>{{"stauts", "status"},
                                                        {"amr", "arm"},
                                                        {"gaer", "gear"},
                                                        {"enrgy", "energy"},
                                                        {"STATUS", "status"},
                                                        {"aknowlege", "acknowledge"},
                                                        {"stat", "status"},
                                                        {"ack", "acknowledge"},
                                                        {"dance", ""},
                                                        {"xyz", ""},
                                                        {"", ""}}) {
    INFO(typed);
    CHECK(nearest_name(typed, commands) == meant);
  }
  CHECK(nearest_name_advice("gaer", commands) == "; did you mean 'gear'?");
  CHECK(nearest_name_advice("dance", commands) == "");
  CHECK(nearest_name(std::string(1'000'000, 'x'), commands) == "");
  CHECK(nearest_name("gear", {}) == "");
}

}  // namespace wrenchd::test_nearest_key
