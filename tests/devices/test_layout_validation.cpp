// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>

#include <catch2/catch.hpp>

#include "devices/layout_validation.hpp"
#include "tests/support/report_round_trip.hpp"

namespace wrenchd::test_layout_validation {

TEST_CASE("the reference layouts are valid") {
  CHECK(validation_error(kPose).empty());
  CHECK(validation_error(kWrench).empty());
}

TEST_CASE("an invalid layout is rejected with the fields and the byte") {
  using Catch::Contains;
  PoseReportLayout pose = kPose;
  pose.orientation.byte = 19;
  CHECK_THAT(validation_error(pose), Contains("orientation") && Contains("position") && Contains("byte 19"));
  pose = kPose;
  pose.watchdog_tripped.bit = 0;
  CHECK_THAT(validation_error(pose), Contains("watchdog_tripped overlaps motors_on at byte 1"));
  pose.watchdog_tripped.bit = 8;
  CHECK_THAT(validation_error(pose), Contains("bits 0 to 7"));
  pose = kPose;
  pose.buttons.byte = 0;
  CHECK_THAT(validation_error(pose), Contains("buttons overlaps the report id"));
  pose = kPose;
  pose.acknowledged.byte = 62;
  CHECK_THAT(validation_error(pose), Contains("acknowledged at byte 62 does not fit"));
  pose = kPose;
  pose.position.present = false;
  CHECK_THAT(validation_error(pose), Contains("position is missing"));
  pose = kPose;
  pose.position.byte = std::numeric_limits<std::size_t>::max() / 8;
  CHECK_THAT(validation_error(pose), Contains("does not fit"));

  WrenchReportLayout wrench = kWrench;
  wrench.length = 31;
  CHECK_THAT(validation_error(wrench), Contains("hold_time at byte 28 does not fit"));
  wrench.length = 2;
  CHECK_THAT(validation_error(wrench), Contains("length = 2"));
  wrench.length = 65;
  CHECK_THAT(validation_error(wrench), Contains("length = 65"));
  wrench = kWrench;
  wrench.force.bits = 65;
  CHECK_THAT(validation_error(wrench), Contains("force must be 1 to 64 bits"));
  wrench = kWrench;
  wrench.torque.count = 2;
  CHECK_THAT(validation_error(wrench), Contains("torque must hold 3 integers"));
  wrench = kWrench;
  wrench.force.step = 0.0;
  CHECK_THAT(validation_error(wrench), Contains("force needs a finite step"));
}

}  // namespace wrenchd::test_layout_validation
