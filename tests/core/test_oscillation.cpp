// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/oscillation.hpp"
#include "devices/simulation/simulated_handle.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_oscillation {

using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;

/// A handle held by a hand, in contact with a wall z < 0 of this stiffness with a delay of `delay` ticks. The
/// detector receives each tick. The velocity is quantised by an encoder.
struct OnWall {
  double stiffness_N_per_m = 1000.0;
  std::size_t delay = 0;
  SimulationSettings hand{};
  double quantum_m = 10e-6;

  /// goal: height of the hand's goal over time. Returns the detection time; below 0 without a detection.
  template <class Goal>
  double fired_s(double seconds, const Goal& goal) {
    constexpr int kSubsteps = 16;
    hand.actuator_max_force_N = 60.0;
    SimulatedHandle handle(hand, {Quaterniond::Identity(), {0.0, 0.0, goal(0.0)}}, kTick_s / kSubsteps);
    OscillationDetector detector;
    std::array<Wrench, 64> sent{};
    double last_m = 0.0, turned_at_m = 0.0, turned_at_s = 0.0, last_v = 0.0;
    touched = false;
    swings_from_s = -1.0;
    for (std::size_t tick = 0; static_cast<double>(tick) * kTick_s < seconds; ++tick) {
      const double t = static_cast<double>(tick) * kTick_s;
      const double z_m = quantum_m * std::round(handle.X_BH().translation_m.z() / quantum_m);
      const Wrench F{{0.0, 0.0, z_m < 0.0 ? -stiffness_N_per_m * z_m : 0.0}, Vector3d::Zero()};
      sent[tick % sent.size()] = F;
      const Wrench acting = tick < delay ? Wrench{} : sent[(tick - delay) % sent.size()];
      const double v = tick == 0 ? 0.0 : (z_m - last_m) / kTick_s;
      last_m = z_m;
      touched = touched || z_m < 0.0;
      const double true_v = handle.V_BH().linear_m_per_s.z(), true_m = handle.X_BH().translation_m.z();
      if (true_v * last_v < 0.0) {
        if (swings_from_s < 0.0 && touched && t - turned_at_s <= 0.025 &&
            std::abs(true_m - turned_at_m) >= 3e-4)
          swings_from_s = turned_at_s;
        turned_at_s = t;
        turned_at_m = true_m;
      }
      last_v = true_v;
      detector.update(acting, {{0.0, 0.0, v}, Vector3d::Zero()}, kTick_s, z_m < 0.0);
      if (detector.oscillates()) return t;
      for (int i = 0; i < kSubsteps; ++i)
        handle.step({{Quaterniond::Identity(), {0.0, 0.0, goal(t)}}, {}}, acting);
    }
    return -1.0;
  }
  bool touched = false;         ///< true if the handle touched the wall
  double swings_from_s = -1.0;  ///< start of the first swing of 0.3 mm within 25 ms
};

/// A wave along one axis of motion against a force of the opposite sign.
bool fires(double amplitude, double Hz, double seconds, int axis, double work_force, bool contact = true) {
  OscillationDetector detector;
  const double w = 2.0 * std::numbers::pi * Hz;
  for (double t = 0.0; t < seconds; t += kTick_s / 4.0) {
    Wrench F;
    Twist V;
    (axis < 3 ? V.linear_m_per_s[axis] : V.angular_rad_per_s[axis - 3]) = amplitude * w * std::cos(w * t);
    (axis < 3 ? F.force_N[axis] : F.torque_Nm[axis - 3]) = -work_force * std::sin(w * t);
    detector.update(F, V, kTick_s / 4.0, contact);
  }
  return detector.oscillates();
}

}  // namespace

TEST_CASE("a limit cycle at a wall that is too stiff is detected within 50 ms", "[oscillation]") {
  for (const double stiffness : {6000.0, 7000.0, 8000.0}) {  // 35 Hz and more
    OnWall wall;
    wall.stiffness_N_per_m = stiffness;
    wall.delay = 1;
    wall.hand.hand_stiffness_N_per_m = 800.0;
    wall.hand.hand_damping_N_s_per_m = 2.0;
    wall.hand.handle_mass_kg = 0.08;
    INFO(stiffness << " N/m");
    // A force that grows to 12 N.
    const double fired = wall.fired_s(2.0, [](double t) { return std::max(-0.015, 0.001 - 0.05 * t); });
    REQUIRE(fired > 0.0);
    REQUIRE(wall.swings_from_s > 0.0);
    CHECK(fired - wall.swings_from_s <= 0.050);
  }
}

TEST_CASE("a hard tap is not an oscillation", "[oscillation]") {
  for (const double stiffness : {300.0, 800.0}) {
    for (const double depth_m : {0.005, 0.015, 0.03}) {
      OnWall wall;
      wall.stiffness_N_per_m = stiffness;
      wall.hand.hand_stiffness_N_per_m = 800.0;
      INFO(stiffness << " N/m, " << depth_m << " m");
      CHECK(wall.fired_s(1.5, [&](double t) { return t > 0.1 && t < 0.16 ? -depth_m : 0.02; }) < 0.0);
      CHECK(wall.fired_s(1.5, [&](double t) { return t > 0.1 ? -depth_m : 0.02; }) <
            0.0);  // stays in contact
      CHECK(wall.touched);
    }
  }
}

TEST_CASE("a tremor is not an oscillation", "[oscillation]") {
  for (const double Hz : {4.0, 8.0, 10.0, 12.0}) {
    INFO(Hz << " Hz");
    OnWall wall;
    wall.hand.hand_stiffness_N_per_m = 800.0;
    CHECK(wall.fired_s(2.0, [&](double t) {
      return -0.003 + 0.003 * std::sin(2.0 * std::numbers::pi * Hz * t);
    }) < 0.0);
    CHECK_FALSE(fires(0.005, Hz, 2.0, 2, 5.0));
  }
}

TEST_CASE("sliding over the faces of a mesh is not an oscillation", "[oscillation]") {
  // A drum of flat faces 4 mm wide: at 0.2 m/s the normal jumps 50 times per second, and the handle follows
  // the corners by the sagitta of 0.1 mm.
  OscillationDetector detector;
  constexpr double kFace_m = 0.004, kSagitta_m = 1e-4, kSpeed_m_per_s = 0.2;
  double last_m = 0.0;
  for (double t = 0.0; t < 2.0; t += kTick_s) {
    const double along = std::fmod(kSpeed_m_per_s * t, kFace_m) / kFace_m - 0.5;
    const double z_m = -4.0 * kSagitta_m * along * along;
    const double slope = -8.0 * kSagitta_m * along / kFace_m;
    const Vector3d n = Vector3d(-slope, 0.0, 1.0).normalized();
    detector.update({4.0 * n, Vector3d::Zero()},
                    {{kSpeed_m_per_s, 0.0, (z_m - last_m) / kTick_s}, Vector3d::Zero()}, kTick_s, true);
    last_m = z_m;
  }
  CHECK_FALSE(detector.oscillates());
}

TEST_CASE("oscillations between 20 and 400 Hz are detected along and about each axis", "[oscillation]") {
  for (int axis = 0; axis < 6; ++axis) {
    const double lever_m = axis < 3 ? 1.0 : 0.05;
    for (const double Hz : {24.0, 50.0, 100.0, 300.0}) {
      INFO("axis " << axis << ", " << Hz << " Hz");
      CHECK(fires(5e-4 / lever_m, Hz, 3.0 / Hz, axis, 2.0 * lever_m));
      CHECK_FALSE(fires(0.5e-4 / lever_m, Hz, 1.0, axis, 2.0 * lever_m));       // one encoder step
      CHECK_FALSE(fires(5e-4 / lever_m, Hz, 1.0, axis, 0.0));                   // without force of the motors
      CHECK_FALSE(fires(5e-4 / lever_m, Hz, 1.0, axis, 2.0 * lever_m, false));  // without contact
    }
    CHECK_FALSE(fires(5e-4 / lever_m, 18.0, 1.0, axis, 2.0 * lever_m));
    CHECK_FALSE(fires(5e-4 / lever_m, 480.0, 1.0, axis, 2.0 * lever_m));
  }
}

TEST_CASE("a decaying motion is not an oscillation, and the detector can be reset", "[oscillation]") {
  for (const double kept : {0.7, 1.0}) {
    OscillationDetector detector;
    double amplitude_m = 5e-3;
    for (int swing = 0; swing < 8; ++swing) {
      const double path_m = (swing % 2 == 0 ? 1.0 : -1.0) * amplitude_m;
      for (int i = 0; i < 10; ++i)
        detector.update({{-3.0, 0.0, 0.0}, Vector3d::Zero()},
                        {{path_m / (10 * kTick_s), 0.0, 0.0}, Vector3d::Zero()}, kTick_s, true);
      amplitude_m *= kept;
    }
    CHECK(detector.oscillates() == (kept > 0.9));
    detector.reset();
    CHECK_FALSE(detector.oscillates());
  }
}

TEST_CASE("the detector ignores values that are not finite", "[oscillation]") {
  OscillationDetector detector;
  detector.update({{std::nan(""), 0.0, 0.0}, Vector3d::Zero()}, {}, kTick_s, true);
  detector.update({}, {{std::nan(""), 0.0, 0.0}, Vector3d::Zero()}, kTick_s, true);
  detector.update({}, {}, -1.0, true);
  detector.update({}, {}, std::nan(""), true);
  CHECK_FALSE(detector.oscillates());
}

TEST_CASE("the detector allocates nothing", "[oscillation][rt]") {
  OscillationDetector detector;
  const test::RealtimeGuard guard;
  for (int n = 0; n < 1000; ++n)
    detector.update({{1.0, 0.0, 0.0}, Vector3d::Zero()},
                    {{n % 20 < 10 ? 0.1 : -0.1, 0.0, 0.0}, Vector3d::Zero()}, kTick_s, true);
  CHECK(detector.oscillates());
  detector.reset();
  CHECK(guard.allocations() + guard.locks() == 0);
}

}  // namespace wrenchd::test_oscillation
