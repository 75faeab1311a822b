// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/state.hpp"
#include "daemon/live_line.hpp"

namespace wrenchd::test_live_line {

namespace {

using Catch::Contains;

TickRecord record_in(State state, Fault cause) {
  TickRecord record;
  record.state = static_cast<std::uint8_t>(state);
  record.state_cause = cause;
  record.X_WP = {0.001, 0.002, 0.003, 0.0, 0.0, 0.0, 1.0};
  record.contacts = 4;
  record.F_out = {3.0, 4.0, 0.0, 0.0, 0.0, 0.5};
  return record;
}

TEST_CASE("the live line shows pose, contacts, force and torque", "[live_line]") {
  const std::string line = live_line(record_in(State::active, Fault::none), LoopTiming{});
  CHECK_THAT(line, Contains("active") && Contains("+1.0   +2.0   +3.0 mm") && Contains("4 contacts") &&
                       Contains("F +3.00 +4.00 +0.00 N") && Contains("+500.0 mN.m"));
}

TEST_CASE("the live line names the fault of latched and degraded states only", "[live_line]") {
  CHECK_THAT(live_line(record_in(State::fault, Fault::overspeed), LoopTiming{}), Contains("fault:overspeed"));
  CHECK_THAT(live_line(record_in(State::degraded, Fault::sample_late), LoopTiming{}),
             Contains("degraded:sample_late"));
  CHECK_THAT(live_line(record_in(State::active, Fault::sample_late), LoopTiming{}), !Contains("sample_late"));
}

TEST_CASE("the live line states which wrench a device without motors shows", "[live_line]") {
  TickRecord record = record_in(State::active, Fault::none);
  record.F_T = {0.0, 0.0, 2.0, 0.0, 0.0, 0.0};
  CHECK_THAT(live_line(record, LoopTiming{}, ShownWrench::on_tool),
             Contains("F +0.00 +0.00 +2.00 N") && Contains("on the tool (no motors)"));
}

TEST_CASE("the summary has the totals of the loop: every tick, not samples of them", "[live_line]") {
  LoopTotals totals;
  TickRecord record = record_in(State::active, Fault::none);
  totals.add(record);
  for (int i = 1; i < 100; ++i) {
    record.now_ns = i * 1'000'000;
    record.contacts = 0;
    record.F_out = {};
    totals.add(record);
  }
  CHECK(totals.ticks == 100);
  CHECK(totals.ticks_in_contact == 1);
  CHECK(totals.max_force_sent_N == 5.0);
  CHECK(totals.max_torque_sent_Nm == 0.5);
  CHECK_THAT(summary(totals, LoopTiming{}, 0.1),
             Contains("100 ticks in 0.10 s (1000.0 Hz); in contact in 1 ticks; largest force 5.00 N, torque "
                      "500.0 mN.m\n"));
}

}  // namespace
}  // namespace wrenchd::test_live_line
