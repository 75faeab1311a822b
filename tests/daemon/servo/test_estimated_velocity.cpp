// SPDX-License-Identifier: GPL-3.0-or-later
//
// Everything in the loop that reads the velocity of the handle, on emulated devices that report none.

#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>

#include <catch2/catch.hpp>

#include "core/limits.hpp"
#include "core/state_machine.hpp"
#include "daemon/servo/stability_analysis.hpp"
#include "devices/velocity_estimator.hpp"
#include "tests/support/emulated_run.hpp"

namespace wrenchd::test_estimated_velocity {

namespace {

using test::EmulatedRun;

constexpr double kPeriod_s = EmulatedRun::kPeriod_s;

/// Position of the handle over time. The shipped cube touches the shipped table at a height of 25 mm.
using HandMotion = std::function<Vector3d(double t_s)>;

RunConfig config_for(const std::string& profile, const HandMotion& motion, double duration_s) {
  return test::prescribed_motion(
      profile,
      [&](double t_s) {
        return Pose{Quaterniond::Identity(), motion(t_s)};
      },
      duration_s);
}

constexpr Vector3d::Scalar kFreeHeight_m = 0.04;

/// A circle of 20 mm at constant speed, in free space, between the two times; at rest before and after.
HandMotion circle(double from_s, double to_s) {
  return [=](double t_s) {
    constexpr double kRate_Hz = 2.0;
    const double phase = 2.0 * std::numbers::pi * kRate_Hz * (std::clamp(t_s, from_s, to_s) - from_s);
    return Vector3d(0.02 * std::cos(phase), 0.02 * std::sin(phase), kFreeHeight_m);
  };
}
constexpr double kCircleSpeed_m_per_s = 0.02 * 2.0 * std::numbers::pi * 2.0;

constexpr double kCircleAcceleration_m_per_s2 = kCircleSpeed_m_per_s * kCircleSpeed_m_per_s / 0.02;
/// Of the estimate, and of a tick before and after it.
constexpr double kMaxDelay_s = 0.5 * WindowedSlope::kMaxWindow_s + 2.0 * kPeriod_s;

/// Rests in free space, moves into the table, and oscillates there.
HandMotion vibration_in_contact(double rate_Hz, double amplitude_m) {
  return [=](double t_s) {
    constexpr double kDepth_m = 0.0015, kTable_m = 0.025;
    const double down = std::clamp((t_s - 1.5) / 0.5, 0.0, 1.0);
    const double s = down * down * (3.0 - 2.0 * down);
    const double vibration =
        t_s < 2.2 ? 0.0 : amplitude_m * std::sin(2.0 * std::numbers::pi * rate_Hz * (t_s - 2.2));
    return Vector3d(0.0, 0.0, kFreeHeight_m + s * (kTable_m - kDepth_m - kFreeHeight_m) + vibration);
  };
}

LocalModel lasting(LocalModel::Kind kind) {
  LocalModel model;
  model.id = 1;
  model.kind = kind;
  model.expires = TimePoint(std::chrono::seconds(10));
  return model;
}

const std::string kDevices[] = {"polhem", "falcon", "woodenhaptics"};

}  // namespace

TEST_CASE("a device without velocities is calm only when its handle is slow", "[velocity][servo]") {
  for (const std::string& device : kDevices) {
    INFO(device);
    EmulatedRun run(config_for(device, circle(0.0, 3.0), 5.0));
    run.run_until(1.0);
    run.arm();
    run.run_until(2.9, [&] { REQUIRE_FALSE(is_driving(run.state())); });
    CHECK(run.state() == State::waiting);
    CHECK(run.record.estimated_velocity_dofs == (device == "polhem" ? kAllDofs : kLinearDofs));
    run.run_until(3.5);
    CHECK(is_driving(run.state()));
  }
}

TEST_CASE("the power limit holds on a device without velocities", "[velocity][servo]") {
  constexpr double kMaxPower_W = 0.02;
  for (const std::string& device : kDevices) {
    INFO(device);
    RunConfig config = config_for(device, circle(2.0, 9.0), 9.0);
    config.profile.max_power_W = kMaxPower_W;
    EmulatedRun run(config);
    run.run_until(1.0);
    run.arm();
    run.run_until(1.5);
    LocalModel spring = lasting(LocalModel::Kind::spring);
    spring.X_WA.translation_m = {-0.01, 0.0, kFreeHeight_m};
    spring.stiffness_N_per_m = 50.0;
    run.set_model(spring);
    run.run_until(2.2);
    int limited = 0;
    double largest_power_W = 0.0;
    run.run_until(4.0, [&] {
      REQUIRE(is_driving(run.state()));
      limited += (run.record.limit_causes & kPower) != 0 ? 1 : 0;
      // The estimate lags: the power may exceed the limit by force times acceleration times the longest
      // delay.
      const double lag_W = run.force_N().norm() * kCircleAcceleration_m_per_s2 * kMaxDelay_s;
      largest_power_W = std::max(largest_power_W, run.force_N().dot(run.true_velocity_m_per_s) - lag_W);
    });
    CHECK(limited > 100);
    CHECK(largest_power_W < 1.1 * kMaxPower_W);
  }
}

TEST_CASE("a local damper brakes on a device without velocities", "[velocity][servo]") {
  constexpr double kDamping_N_s_per_m = 3.0;
  for (const std::string& device : kDevices) {
    INFO(device);
    EmulatedRun run(config_for(device, circle(2.0, 9.0), 9.0));
    run.run_until(1.0);
    run.arm();
    run.run_until(1.5);
    LocalModel damper = lasting(LocalModel::Kind::damping);
    damper.damping_N_s_per_m = kDamping_N_s_per_m;
    run.set_model(damper);
    run.run_until(2.2);
    double mean_N = 0.0;
    int ticks = 0;
    run.run_until(3.0, [&] {
      mean_N -= run.force_N().dot(run.true_velocity_m_per_s.normalized());
      ++ticks;
    });
    CHECK(mean_N / ticks == Approx(kDamping_N_s_per_m * kCircleSpeed_m_per_s).epsilon(0.1));
  }
}

TEST_CASE("an oscillation is detected on a device without velocities", "[velocity][servo]") {
  for (const std::string& device : kDevices)
    for (const double rate_Hz : {25.0, 60.0}) {
      INFO(device << " at " << rate_Hz << " Hz");
      EmulatedRun run(config_for(device, vibration_in_contact(rate_Hz, 0.8e-3), 4.0));
      FaultSet faults = 0;
      run.run_until(1.0);
      run.arm();
      run.run_until(2.2, [&] { faults |= run.record.faults; });
      CHECK(is_driving(run.state()));
      CHECK((faults & bit(Fault::oscillating)) == 0);
      run.run_until(2.6, [&] { faults |= run.record.faults; });
      CHECK((faults & bit(Fault::oscillating)) != 0);
    }
}

TEST_CASE("slow pressing on a device without velocities is no oscillation", "[velocity][servo]") {
  for (const std::string& device : kDevices) {
    INFO(device);
    EmulatedRun run(config_for(device, vibration_in_contact(3.0, 0.8e-3), 6.0));
    FaultSet faults = 0;
    run.run_until(1.0);
    run.arm();
    run.run_until(5.0, [&] { faults |= run.record.faults; });
    CHECK(is_driving(run.state()));
    CHECK((faults & (bit(Fault::oscillating) | bit(Fault::pose_stuck))) == 0);
  }
}

// METHOD (83): a damper on an estimated velocity counts by the energy gain of the estimate.
TEST_CASE("the stability bound allows less damping on an estimated velocity", "[velocity][stability]") {
  RunConfig config = config_for("polhem", circle(0.0, 1.0), 1.0);
  const Scene scene(config.scene);
  const auto scale_of = [&](const DeviceProfile& profile) {
    const StabilityAnalysis analysis(config.settings, profile, scene.tool().solid.inertia,
                                     scene.tool().X_MT());
    LocalModels::TotalGains gains;
    gains.damping_N_s_per_m = 2.0 * profile.damping_N_s_per_m;
    return analysis.max_stable_scale_at_handle(LoopMeasurement(0.002), gains);
  };
  DeviceProfile reporting = config.profile;
  reporting.pose_report.linear_velocity.present = true;
  CHECK(scale_of(reporting) == Approx(0.5));
  CHECK(scale_of(config.profile) == Approx(0.5 / kEstimateGain));
}

}  // namespace wrenchd::test_estimated_velocity
