// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/velocity_estimator.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_velocity_estimator {

namespace {

using namespace test;
using namespace std::chrono_literals;
using Kind = SimulatedFault::Kind;

DeviceProfile shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml",
                      SearchPath({test::source_path("config")}));
}

/// A profile like the reference layout whose reports have no velocity.
DeviceProfile without_velocity() {
  DeviceProfile profile = reference_profile();
  profile.pose_report.linear_velocity.present = profile.pose_report.angular_velocity.present = false;
  return profile;
}

/// The handle moves exactly along a smooth path: 0.16 m and 0.8 rad in half a second, and back.
SimulationSettings prescribed_motion() {
  SimulationSettings s;
  s.hand_path = {{}};
  for (int i = 0; i <= 1000; ++i) {
    const double t_s = 0.002 * i, phase = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * t_s);
    s.playback_path.push_back(
        {t_s, {rotation_from(Vector3d(0.1, 0.2, 0.1) * phase), Vector3d(0.03, 0.02, 0.02) * phase}});
  }
  s.playback_mode = PlaybackMode::open;
  s.report_delay_s = s.command_delay_s = 0.0;
  return s;
}

/// A device of a profile over its simulated link, in virtual time.
struct Session {
  Session(const DeviceProfile& profile, const SimulationSettings& settings)
      : link(make_simulated_link(profile, settings, clock)), device(profile, *link) {
    device.open();
    sample = device.read_newest(clock.now());
  }
  void step() {
    clock.sleep_until(clock.now() + 1ms);
    previous_X_BH = true_X_BH;
    sample = device.read_newest(clock.now());
    device.write(clock.now(), {}, false);
    true_X_BH = link->device().X_BH();
  }
  /// True velocity over the last step.
  Twist true_velocity() const {
    return {(true_X_BH.translation_m - previous_X_BH.translation_m) / 1e-3,
            rotation_vector(true_X_BH.rotation * previous_X_BH.rotation.conjugate()) / 1e-3};
  }

  VirtualClock clock;
  std::unique_ptr<SimulatedLink> link;
  ProfileDevice device;
  DeviceSample sample;
  Pose true_X_BH, previous_X_BH;
};

}  // namespace

TEST_CASE("the estimated twist of a rotating, moving body is exact", "[velocity]") {
  RandomValues random(3);
  for (int round = 0; round < 50; ++round) {
    const Twist V = random.velocity();
    Pose X = random.pose();
    VelocityEstimator estimator({1e-9, 1e-9, 0.0});
    Twist estimate;
    for (int i = 0; i < 40; ++i) {
      estimate = estimator.update(i * 1e-3, X);
      X.translation_m += 1e-3 * V.linear_m_per_s;
      X.rotation = (rotation_from(1e-3 * V.angular_rad_per_s) * X.rotation).normalized();
    }
    CHECK((estimate.linear_m_per_s - V.linear_m_per_s).norm() < 1e-9);
    CHECK((estimate.angular_rad_per_s - V.angular_rad_per_s).norm() < 1e-9);
  }
}

TEST_CASE("the settings of an estimator are those of the profile", "[velocity]") {
  DeviceProfile profile = without_velocity();
  profile.encoder_step_m = 40e-6;
  profile.encoder_step_rad = 1e-3;
  const auto stated = velocity_estimator_settings(profile);
  CHECK(stated.step_m == 40e-6);
  CHECK(stated.step_rad == 1e-3);
  CHECK(stated.time_error_s == Approx(0.5e-6));  // the clock of the device counts microseconds
  // Polhem: 2000 counts a turn, capstan 10 mm, body 180 mm, 0.133 m and 0.174 m from the axes.
  const auto arm = velocity_estimator_settings(shipped("polhem"));
  CHECK(arm.step_m > 10e-6);
  CHECK(arm.step_m < 100e-6);
  CHECK(arm.time_error_s == Approx(1e-4));  // no clock: times of arrival
}

TEST_CASE("reported velocities are used, and missing ones are estimated and marked", "[velocity]") {
  DeviceProfile profile = reference_profile();
  CHECK(estimated_velocity_dofs(profile) == kNoDof);
  profile.pose_report.angular_velocity.present = false;
  CHECK(estimated_velocity_dofs(profile) == kAngularDofs);
  CHECK(estimated_velocity_dofs(without_velocity()) == kAllDofs);
  CHECK(estimated_velocity_dofs(shipped("polhem")) == kAllDofs);
  CHECK(estimated_velocity_dofs(shipped("falcon")) == kLinearDofs);
  CHECK(estimated_velocity_dofs(shipped("woodenhaptics")) == kLinearDofs);
  CHECK(estimated_velocity_dofs(shipped("spacemouse_combined")) == kNoDof);

  Session session(profile, prescribed_motion());
  for (int i = 0; i < 200; ++i) session.step();
  CHECK(session.sample.estimated_velocity_dofs == kAngularDofs);
  const Twist V = session.true_velocity();
  CHECK((session.sample.V_BH.angular_rad_per_s - V.angular_rad_per_s).norm() <
        0.1 * V.angular_rad_per_s.norm());
}

TEST_CASE("the estimate follows the hand on every device that reports no velocity", "[velocity]") {
  struct Case {
    DeviceProfile profile;
    double max_error_m_per_s, max_error_rad_per_s;
  };
  // A count of a wrist encoder of the Polhem is 6 mrad.
  for (const Case& c : {Case{without_velocity(), 0.02, 0.1}, Case{shipped("polhem"), 0.03, 0.8},
                        Case{shipped("falcon"), 0.03, 0.0}, Case{shipped("woodenhaptics"), 0.03, 0.0}}) {
    INFO(c.profile.name);
    Session session(c.profile, prescribed_motion());
    double fastest_m_per_s = 0.0, error_m_per_s = 0.0, error_rad_per_s = 0.0;
    for (int i = 0; i < 1900; ++i) {
      session.step();
      if (i < 900) continue;  // a Falcon is homed in the first half second
      REQUIRE(session.sample.fault == Fault::none);
      const Twist V = session.true_velocity(), estimate = session.sample.V_BH;
      fastest_m_per_s = std::max(fastest_m_per_s, V.linear_m_per_s.norm());
      error_m_per_s = std::max(error_m_per_s, (estimate.linear_m_per_s - V.linear_m_per_s).norm());
      error_rad_per_s = std::max(error_rad_per_s, (estimate.angular_rad_per_s - V.angular_rad_per_s).norm());
    }
    CHECK(fastest_m_per_s > 0.1);
    CHECK(error_m_per_s < c.max_error_m_per_s);
    CHECK(error_rad_per_s <= c.max_error_rad_per_s);
  }
}

TEST_CASE("the estimate restarts after silence, a jump and a reconnection", "[velocity]") {
  const auto at_full_speed = [](Session& session) {
    for (int i = 0; i < 200; ++i) session.step();
    REQUIRE(session.sample.V_BH.linear_m_per_s.norm() > 0.05);
  };
  SECTION("silence") {
    Session session(without_velocity(), prescribed_motion());
    session.link->device().inject({Kind::silence, 200ms, 30ms});
    at_full_speed(session);
    do session.step();
    while (session.sample.device_time_s < 0.215);
    CHECK(session.sample.V_BH.linear_m_per_s.norm() == 0.0);
    session.step();
    CHECK(session.sample.V_BH.linear_m_per_s.norm() > 0.05);
  }
  SECTION("jump") {
    Session session(without_velocity(), prescribed_motion());
    session.link->device().inject({Kind::jump, 201ms, 50ms});
    at_full_speed(session);
    double fastest_m_per_s = 0.0;
    for (int i = 0; i < 100; ++i) {
      session.step();
      fastest_m_per_s = std::max(fastest_m_per_s, session.sample.V_BH.linear_m_per_s.norm());
    }
    CHECK(fastest_m_per_s < 0.3);  // a difference across the jump would be 100 m/s
  }
  SECTION("reconnection") {
    Session session(without_velocity(), prescribed_motion());
    at_full_speed(session);
    session.device.close();
    session.device.open();
    session.device.read_newest(session.clock.now());
    session.step();
    CHECK(session.sample.V_BH.linear_m_per_s.norm() == 0.0);
  }
}

TEST_CASE("lost reports change the estimate little", "[velocity]") {
  Session session(without_velocity(), prescribed_motion());
  session.link->device().inject({Kind::drop_reports, 0ms, 10s, 20.0});
  double error_m_per_s = 0.0;
  std::uint64_t missing = 0;
  for (int i = 0; i < 1500; ++i) {
    session.step();
    missing += session.sample.missing;
    if (i < 50 || !session.sample.fresh) continue;
    const Twist V = session.true_velocity();
    error_m_per_s = std::max(error_m_per_s, (session.sample.V_BH.linear_m_per_s - V.linear_m_per_s).norm());
  }
  CHECK(missing > 60);
  CHECK(error_m_per_s < 0.02);
}

// METHOD (83b): what a damper on the estimate can draw from the friction of a device.
TEST_CASE("the energy of an estimate is at most kEstimateGain^2 times that of the velocity", "[velocity]") {
  RandomValues random(4);
  double largest_gain = 0.0;
  for (int round = 0; round < 400; ++round) {
    const double step_m = random.log_uniform(1e-7, 1e-3), loss = random.uniform(0.0, 0.05);
    const double frequency_Hz = random.log_uniform(5.0, 450.0), speed_m_per_s = random.log_uniform(0.01, 1.0);
    WindowedSlope slope(step_m);
    double t_s = 0.0, x_m = 0.0, true_m2_per_s = 0.0, estimated_m2_per_s = 0.0, v_est = 0.0;
    for (int i = 0; i < 1500; ++i) {
      const bool burst = std::fmod(t_s, 0.05) < 0.01;  // changes of speed make the windows change
      const double v =
          speed_m_per_s * (burst ? 1.0 : 0.02) * std::sin(2.0 * std::numbers::pi * frequency_Hz * t_s) +
          0.1 * speed_m_per_s * random.normal();
      t_s += 1e-3;
      x_m += 1e-3 * v;
      if (!random.chance(loss)) v_est = slope.update(t_s, Vector3d(x_m, 0.0, 0.0)).x();
      true_m2_per_s += v * v;
      estimated_m2_per_s += v_est * v_est;
    }
    largest_gain = std::max(largest_gain, std::sqrt(estimated_m2_per_s / true_m2_per_s));
  }
  CHECK(largest_gain < kEstimateGain);
}

TEST_CASE("an update allocates nothing", "[velocity][realtime]") {
  RandomValues random(5);
  VelocityEstimator estimator({1e-5, 1e-4, 1e-4});
  Pose X;
  const RealtimeGuard guard;
  for (int i = 0; i < 5000; ++i) {
    X.translation_m += random.vector<3>(1e-4);
    X.rotation = (rotation_from(random.vector<3>(1e-3)) * X.rotation).normalized();
    estimator.update(i * 1e-3, X);
    if (i % 100 == 0) estimator.reset();
  }
  CHECK(guard.allocations() == 0);
  CHECK(guard.locks() == 0);
}

}  // namespace wrenchd::test_velocity_estimator
