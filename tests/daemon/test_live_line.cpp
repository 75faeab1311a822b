// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/state.hpp"
#include "daemon/live_line.hpp"

namespace wrenchd {
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

TEST_CASE("the totals contain the largest force and torque and the samples in contact", "[live_line]") {
  RunTotals totals;
  TickRecord record = record_in(State::active, Fault::none);
  add_sample(totals, record);
  record.contacts = 0;
  record.F_out = {};
  record.tick = 99;
  add_sample(totals, record);
  CHECK(totals.samples == 2);
  CHECK(totals.samples_in_contact == 1);
  CHECK(totals.ticks == 100);
  CHECK(totals.max_force_N == 5.0);
  CHECK(totals.max_torque_Nm == 0.5);
}

}  // namespace
}  // namespace wrenchd
