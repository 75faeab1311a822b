// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/fault.hpp"
#include "tools/fault_text.hpp"

namespace wrenchd::test_fault_text {

using Catch::Matchers::Contains;

TEST_CASE("the fault text contains every fault with reaction and remedy", "[fault_text]") {
  const std::string text = fault_text();
  for (const FaultRow& row : fault_rows()) {
    CHECK_THAT(text, Contains(std::string(row.name) + "\n"));
    CHECK_THAT(text, Contains(std::string(row.cure)));
  }
  CHECK_THAT(fault_text("overspeed"), Contains("state fault; in the same tick, no force in that tick"));
  CHECK_THAT(fault_text("sample_late"),
             Contains("state degraded; after 3 ms, within one tick, no force 10 ms later"));
  CHECK_THAT(fault_text("heartbeat_lost"),
             Contains("state releasing; after 100 ms, within one tick, no force 100 ms later"));
  CHECK_THAT(fault_text("overheated"), Contains("the loop reports it, and the force remains"));
}

TEST_CASE("an unknown fault name is rejected with the list of names", "[fault_text]") {
  CHECK_THROWS_WITH(fault_text("hunger"), Contains("there is no fault 'hunger'") && Contains("overspeed"));
  CHECK_THROWS_WITH(fault_text("tick_lat"), "there is no fault 'tick_lat'; did you mean 'tick_late'?");
}

TEST_CASE("the state machine is printed row by row", "[fault_text]") {
  const std::string text = state_machine_text();
  CHECK(std::count(text.begin(), text.end(), '\n') == static_cast<long>(transitions().size()) + 1);
  CHECK_THAT(text,
             Contains("hard fault") && Contains("a user must acknowledge before force is possible again"));
}

}  // namespace wrenchd::test_fault_text
