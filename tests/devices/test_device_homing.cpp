// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/device_homing.hpp"
#include "tests/support/polhem_in_hand.hpp"

namespace wrenchd::test_device_homing {

namespace {

using namespace test;

/// Steps until homing has ended, at most half a minute.
HomingState home_pose(PolhemInHand& polhem, DeviceHoming& homing, bool confirming = true) {
  for (int ms = 0; ms < 30000; ++ms) {
    polhem.clock.sleep_until(polhem.clock.now() + std::chrono::milliseconds(1));
    const HomingState before = homing.state();
    const HomingState& state = homing.step(polhem.clock.now());
    if (state.step != before.step || state.axis != before.axis) polhem.follow_instructions(state);
    if (confirming && state.step == HomingStep::reference && state.progress == 1.0) homing.confirm();
    polhem.step();
    if (state.step == HomingStep::done || state.step == HomingStep::failed || homing.device_lost()) break;
  }
  return homing.state();
}

/// Error of the device's pose: [m] and [rad].
Eigen::Vector2d error(PolhemInHand& polhem) {
  DeviceSample sample;
  for (int ms = 0; ms < 50; ++ms) {
    polhem.clock.sleep_until(polhem.clock.now() + std::chrono::milliseconds(1));
    sample = polhem.device.read_newest(polhem.clock.now());
    polhem.device.write(polhem.clock.now(), {}, false);
  }
  REQUIRE(sample.fault == Fault::none);
  return {(sample.X_BH.translation_m - polhem.X_BH.translation_m).norm(),
          sample.X_BH.rotation.angularDistance(polhem.X_BH.rotation)};
}

/// One count of the coarsest encoder is 2 pi / 1024 rad, of the arm about 0.02 mm. The reference and the pose
/// each have an error of half a count, in several joints.
constexpr double kResolution_m = 2e-4;
constexpr double kResolution_rad = 0.02;

}  // namespace

TEST_CASE("the reference pose gives the offsets of incremental encoders", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  CHECK(error(polhem)[0] > 0.01);
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
  REQUIRE(home_pose(polhem, homing).step == HomingStep::done);
  CHECK(homing.offsets().size() == 6);
  polhem.target.translation_m += Vector3d(-0.05, 0.03, 0.02);
  for (int ms = 0; ms < 1000; ++ms) polhem.step();
  polhem.device.recalibrate(
      apply_calibration(polhem.profile, homing.offsets()));  // the displacement was no motion
  CHECK(error(polhem)[0] < kResolution_m);
  CHECK(error(polhem)[1] < kResolution_rad);
  CHECK(polhem.board.currents_mA() == std::array<int, 3>{});
}

TEST_CASE("homing a homed device replaces its offsets", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  for (int time = 0; time < 2; ++time) {
    DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
    REQUIRE(home_pose(polhem, homing).step == HomingStep::done);
    CHECK(error(polhem)[0] < kResolution_m);
  }
}

TEST_CASE("a calibration checks the axes after it has applied the reference offsets", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::full);
  REQUIRE(home_pose(polhem, homing).step == HomingStep::done);
  CHECK(error(polhem)[0] < kResolution_m);
}

TEST_CASE("a wrong axis direction fails a calibration", "[device_homing]") {
  PolhemInHand polhem;
  polhem.swapped_axis = 1;
  polhem.device.open();
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::full);
  const HomingState state = home_pose(polhem, homing);
  CHECK(state.step == HomingStep::failed);
  CHECK(state.problem == HomingProblem::wrong_axis);
}

TEST_CASE("without a confirmation the reference pose is not measured", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
  CHECK(home_pose(polhem, homing, false).step == HomingStep::reference);
  CHECK(homing.offsets().empty());
}

TEST_CASE("the button of the profile confirms the reference pose", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  polhem.board.set_handle_button(true);
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
  CHECK(home_pose(polhem, homing, false).step == HomingStep::done);
}

TEST_CASE("an unplugged device is reported during homing", "[device_homing]") {
  PolhemInHand polhem;
  polhem.device.open();
  DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
  for (int i = 0; i < 10; ++i) homing.step(polhem.clock.now());
  CHECK_FALSE(homing.device_lost());
  polhem.unplug();
  polhem.clock.sleep_until(polhem.clock.now() + std::chrono::milliseconds(1));
  homing.step(polhem.clock.now());
  CHECK(homing.device_lost());
}

TEST_CASE("a device with absolute encoders needs no reference pose at the start", "[device_homing]") {
  PolhemInHand polhem;
  polhem.profile.homing.reference = ReferenceSchedule::never;
  polhem.device.open();
  const DeviceHoming homing(polhem.device, polhem.profile, DeviceHoming::Extent::reference_only);
  CHECK(homing.state().step == HomingStep::done);
}

}  // namespace wrenchd::test_device_homing
