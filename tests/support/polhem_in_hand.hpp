// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "config/load_profile.hpp"
#include "devices/calibrated_profile.hpp"
#include "devices/homing.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/emulated_polhem.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test {

inline DeviceProfile polhem_profile() {
  return load_profile(source_path("config/profiles/polhem.toml"), SearchPath({source_path("config")}));
}

/// A Polhem whose counters start at an arbitrary pose, and a simulated person who follows the homing
/// instructions. Runs in virtual time.
struct PolhemInHand {
  VirtualClock clock;
  DeviceProfile profile = polhem_profile();
  EmulatedPolhem board{64};
  LoopbackLink link{board, clock};
  ProfileDevice device{profile, link};
  Pose X_BH;    ///< true pose of the handle
  Pose target;  ///< pose to which the person moves the handle
  JointCounts at_power_on{};
  std::size_t swapped_axis = 6;  ///< index of the axis that the person confuses with the next axis; 6: none

  /// X_home_start: pose of the handle at power-on, relative to its home pose.
  explicit PolhemInHand(const Pose& X_home_start = {Quaterniond::Identity(), {-0.03, 0.02, 0.04}}) {
    X_BH = target = homing_plan(profile).X_BR * X_home_start;
    at_power_on = counts();
    update_encoders();
  }

  /// Unplugs the device permanently.
  void unplug() {
    board.inject({SimulatedFault::Kind::unplug, clock.now() - TimePoint{}, std::chrono::hours(1)});
  }

  JointCounts counts() const {
    const auto angles = inverse(profile.kinematics, inverse(profile.X_BD) * X_BH * inverse(profile.X_EH));
    return joint_counts(profile.kinematics, angles.value());
  }
  void update_encoders() {
    std::array<int, 6> turned{};
    const JointCounts now = counts();
    for (std::size_t i = 0; i < 6; ++i) turned[i] = static_cast<int>(std::lround(now[i] - at_power_on[i]));
    board.set_encoder_counts(turned);
  }
  /// Moves the hand for 1 ms at 0.1 m/s and 1 rad/s.
  void step() {
    const Vector3d way = target.translation_m - X_BH.translation_m;
    X_BH.translation_m += way * std::min(1.0, 1e-4 / std::max(way.norm(), 1e-12));
    const Vector3d turn_left = rotation_vector(target.rotation * X_BH.rotation.conjugate());
    X_BH.rotation =
        (rotation_from(turn_left * std::min(1.0, 1e-3 / std::max(turn_left.norm(), 1e-12))) * X_BH.rotation)
            .normalized();
    update_encoders();
  }
  /// Chooses the hand's next target according to the homing state.
  void follow_instructions(const HomingState& state) {
    if (state.step == HomingStep::reference) target = homing_plan(profile).X_BR;
    if (state.step != HomingStep::moving) return;
    const std::size_t axis = state.axis == swapped_axis ? state.axis + 1 : state.axis;
    const auto k = static_cast<Eigen::Index>(axis % 3);
    if (axis < 3)
      target.translation_m[k] = X_BH.translation_m[k] + 0.03;
    else
      target.rotation = (rotation_from(0.35 * Vector3d(Vector3d::Unit(k))) * X_BH.rotation).normalized();
  }
};

}  // namespace wrenchd::test
