// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/homing.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/polhem_in_hand.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_calibrated_profile {

namespace {

using namespace test;
using Catch::Contains;

}  // namespace

TEST_CASE("apply_calibration() adds a pose offset to the frames of the profile", "[calibrated_profile]") {
  RandomValues random(61);
  for (int i = 0; i < 100; ++i) {
    DeviceProfile profile = reference_profile();
    profile.X_BD = {random.rotation(2.0), 0.1 * random.unit<3>()};
    profile.X_EH = {random.rotation(2.0), 0.1 * random.unit<3>()};
    profile.homing.X_BR = {random.rotation(2.0), 0.1 * random.unit<3>()};
    const Pose X_DE = {random.rotation(3.0), 0.2 * random.unit<3>()};
    const Pose reported = profile.X_BD * X_DE * profile.X_EH;
    const auto offsets = offsets_at_reference(profile, reported, {});
    const DeviceProfile after = apply_calibration(profile, offsets);
    const Pose X_BH = after.X_BD * X_DE * after.X_EH;
    CHECK((X_BH.translation_m - profile.homing.X_BR.translation_m).norm() < 1e-12);
    CHECK(X_BH.rotation.angularDistance(profile.homing.X_BR.rotation) < 1e-7);
  }
}

TEST_CASE("apply_calibration() adds joint offsets to the joint zeros", "[calibrated_profile]") {
  const DeviceProfile profile = polhem_profile();
  const Kinematics& k = profile.kinematics;
  JointAngles reported = joint_angles(k, k.home_counts);
  for (std::size_t i = 0; i < 6; ++i) reported[i] += 0.1 * static_cast<double>(i + 1);
  const auto offsets = offsets_at_reference(profile, {}, reported);
  REQUIRE(offsets.size() == 6);
  CHECK(offsets[2].axis == "joint_3");
  CHECK(offsets[2].offset == Approx(0.3));
  const Kinematics after = apply_calibration(profile, offsets).kinematics;
  const JointAngles at_rest = joint_angles(after, joint_counts(k, reported));
  for (std::size_t i = 0; i < 6; ++i)
    CHECK(at_rest[i] == Approx(joint_angles(k, k.home_counts)[i]).margin(1e-12));
}

TEST_CASE("a stated reference pose takes precedence over the home position", "[calibrated_profile]") {
  DeviceProfile profile = polhem_profile();
  const Pose home = homing_plan(profile).X_BR;
  profile.has_reference_pose = true;
  profile.homing.X_BR = {home.rotation, home.translation_m + Vector3d(0.02, 0.01, -0.03)};
  const Pose X_DE = inverse(profile.X_BD) * profile.homing.X_BR * inverse(profile.X_EH);
  const JointAngles angles = inverse(profile.kinematics, X_DE).value();
  for (const AxisOffset& offset : offsets_at_reference(profile, {}, angles))
    CHECK(std::abs(offset.offset) < 1e-9);
  profile.homing.X_BR.translation_m.x() = 2.0;
  CHECK_THROWS_WITH(offsets_at_reference(profile, {}, angles), Contains("no joint angles reach"));
}

TEST_CASE("a calibration axis that the device does not have is rejected", "[calibrated_profile]") {
  CHECK_THROWS_WITH(apply_calibration(polhem_profile(), {{"joint_7", 0.1}}),
                    Contains("joint_7") && Contains("polhem"));
  CHECK_THROWS_WITH(apply_calibration(polhem_profile(), {{"x", 0.1}}), Contains("axis x"));
  CHECK_THROWS_WITH(apply_calibration(reference_profile(), {{"joint_1", 0.1}}), Contains("joint_1"));
}

TEST_CASE("homing asks only for the axes that the device senses", "[calibrated_profile]") {
  DeviceProfile profile = polhem_profile();
  CHECK(homing_plan(profile).sensed == std::array<bool, 6>{true, true, true, true, true, true});
  profile.kinematics.joints = 3;
  CHECK(homing_plan(profile).sensed == std::array<bool, 6>{true, true, true, false, false, false});
}

}  // namespace wrenchd::test_calibrated_profile
