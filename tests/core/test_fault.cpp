// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "core/fault.hpp"

namespace wrenchd::test_fault {

TEST_CASE("every fault has a unique name, a detector, a message, a reason and a remedy", "[fault]") {
  std::set<std::string> names, sentences;
  CHECK(fault_rows().size() == kFaultCount - 1);
  for (const FaultRow& row : fault_rows()) {
    INFO(row.name);
    CHECK(&fault_row(row.fault) == &row);
    CHECK(row.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string_view::npos);
    for (const std::string_view text : {row.detector, row.message, row.reason, row.cure}) {
      CHECK(text.find(' ') != std::string_view::npos);
      CHECK(text.back() != '.');
    }
    names.emplace(row.name);
    sentences.emplace(row.message);
  }
  CHECK(names.size() == kFaultCount - 1);
  CHECK(sentences.size() == kFaultCount - 1);
}

TEST_CASE("latching faults remove the force immediately, and their remedy names the acknowledgement",
          "[fault]") {
  for (const FaultRow& row : fault_rows()) {
    INFO(row.name);
    const bool latches = row.trigger == Trigger::hard_fault || row.trigger == Trigger::self_test_failed ||
                         row.trigger == Trigger::stop;
    if (latches) CHECK(row.reaction == Reaction::zero);
    if (latches) CHECK(row.cure.find("acknowledge") != std::string_view::npos);
    if (row.trigger == Trigger::info) CHECK(row.reaction == Reaction::none);
    if (row.trigger != Trigger::info) CHECK(row.reaction >= Reaction::fade_100ms);
  }
}

TEST_CASE("fault names in records", "[fault]") {
  CHECK(fault_row(Fault::none).name == "none");
  CHECK(fault_row(Fault::device_lost).name == "device_lost");
  CHECK(fault_row(Fault::pose_not_finite).name == "pose_not_finite");
  CHECK(fault_row(Fault::sample_stale).name == "sample_stale");
  CHECK(fault_row(Fault::self_test_watchdog).name == "self_test_watchdog");
}

TEST_CASE("an invalid fault value is named unknown", "[fault]") {
  for (std::size_t value = kFaultCount; value < 256; ++value) {
    const FaultRow& row = fault_row(static_cast<Fault>(value));
    REQUIRE(row.name == "unknown");
    REQUIRE(row.trigger == Trigger::hard_fault);
    REQUIRE_FALSE(row.message.empty());
    REQUIRE_FALSE(row.cure.empty());
  }
}

}  // namespace wrenchd::test_fault
