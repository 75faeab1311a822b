// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/event_description.hpp"

namespace wrenchd::test_event_description {

namespace {

std::string text(const Event::Data& data) {
  return describe({TimePoint{}, data}).text;
}

}  // namespace

TEST_CASE("each event is described by one line, a fault with its cure", "[events]") {
  CHECK(text(Event::FaultRaised{Fault::device_lost, 0.0}) ==
        "device_lost: " + std::string(fault_row(Fault::device_lost).message) + "; " +
            std::string(fault_row(Fault::device_lost).cure));
  CHECK(text(Event::StateChanged{State::active, Fault::none}) == "state: active");
  CHECK(text(Event::ProxyFound{0.0125}) == "proxy initialized 12.5 mm from the hand");
  CHECK(text(Event::ProxySearchStarted{}).find("zero wrench until") != std::string::npos);
  CHECK(text(Event::ProxySearchFailed{}).find("the tool does not fit") != std::string::npos);
  CHECK(text(Event::FaultRaised{Fault::tick_late, 0.0305}).find("tick_late: ") == 0);
  CHECK(text(Event::FaultRaised{Fault::tick_late, 0.0305}).find(" (30.5 ms); ") != std::string::npos);
  CHECK(text(Event::FaultRaised{Fault::self_test_rate, 499.7}).find(" (500 reports/s); ") !=
        std::string::npos);
  CHECK(text(Event::ArmingRejected{State::fault}) ==
        std::string("not armed: ") + transition(Trigger::arm, State::fault).reason);
  CHECK(text(Event::StiffnessScaled{0.25}).find("25 %") != std::string::npos);
}

TEST_CASE("each event has the same content in fields for programs", "[events]") {
  const EventDescription state =
      describe({TimePoint{}, Event::StateChanged{State::degraded, Fault::sample_late}});
  CHECK(state.name == "state");
  CHECK(state.fields["state"] == "degraded");
  CHECK(state.fields["cause"]["name"] == "sample_late");
  CHECK(describe({TimePoint{}, Event::StateChanged{State::active, Fault::none}}).fields["cause"].is_null());
  const EventDescription found = describe({TimePoint{}, Event::ProxyFound{0.25}});
  CHECK(found.fields["outcome"] == "found");
  CHECK(found.fields["distance_m"] == 0.25);
  CHECK(describe({TimePoint{}, Event::StabilityBoundUnknown{}}).fields["scale"].is_null());
  CHECK(describe({TimePoint{}, Event::RenderingChanged{7}}).fields["rendering_id"] == 7);
}

TEST_CASE("a latched fault is logged as an error, a passing fault as a warning", "[events]") {
  CHECK(describe({TimePoint{}, Event::FaultRaised{Fault::sample_stale, 0.0}}).level == EventLevel::error);
  CHECK(describe({TimePoint{}, Event::FaultRaised{Fault::sample_late, 0.0}}).level == EventLevel::warning);
  CHECK(describe({TimePoint{}, Event::Released{}}).level == EventLevel::info);
}

}  // namespace wrenchd::test_event_description
