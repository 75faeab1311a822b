// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "core/fault.hpp"

using namespace wrenchd;

TEST_CASE("every fault has a name of its own, a sentence and a cure", "[fault]") {
  std::set<std::string> names;
  std::set<std::string> sentences;
  const int last = static_cast<int>(Fault::write_failed);
  for (int value = 0; value <= last; ++value) {
    const FaultText what = text(static_cast<Fault>(value));
    INFO(what.name);
    CHECK_FALSE(what.name.empty());
    CHECK(what.name != "unknown");
    CHECK(what.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string_view::npos);
    CHECK(what.sentence.find(' ') != std::string_view::npos);
    CHECK(what.cure.find(' ') != std::string_view::npos);
    names.emplace(what.name);
    sentences.emplace(what.sentence);
  }
  CHECK(names.size() == static_cast<std::size_t>(last) + 1);
  CHECK(sentences.size() == static_cast<std::size_t>(last) + 1);
}

TEST_CASE("the names that stand in records", "[fault]") {
  CHECK(text(Fault::none).name == "none");
  CHECK(text(Fault::device_lost).name == "device_lost");
  CHECK(text(Fault::pose_not_finite).name == "pose_not_finite");
  CHECK(text(Fault::pose_not_a_rotation).name == "pose_not_a_rotation");
  CHECK(text(Fault::pose_teleported).name == "pose_teleported");
  CHECK(text(Fault::overspeed).name == "overspeed");
  CHECK(text(Fault::sample_stale).name == "sample_stale");
  CHECK(text(Fault::wrench_not_finite).name == "wrench_not_finite");
  CHECK(text(Fault::write_failed).name == "write_failed");
}

TEST_CASE("a value that is no fault reads unknown", "[fault]") {
  for (int value = static_cast<int>(Fault::write_failed) + 1; value < 256; ++value) {
    const FaultText what = text(static_cast<Fault>(value));
    REQUIRE(what.name == "unknown");
    REQUIRE_FALSE(what.sentence.empty());
    REQUIRE_FALSE(what.cure.empty());
  }
}
