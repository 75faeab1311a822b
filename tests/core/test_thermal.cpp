// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <catch2/catch.hpp>

#include "core/device_profile.hpp"
#include "core/limits.hpp"
#include "core/thermal.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_thermal {

using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;

/// Motors of the loopback device.
DeviceProfile motors(double continuous_force_N = 4.0, double continuous_torque_Nm = 0.2,
                     double thermal_time_s = 20.0) {
  DeviceProfile profile;
  profile.max_force_N = 10.0;
  profile.max_torque_Nm = 0.5;
  profile.continuous_force_N = continuous_force_N;
  profile.continuous_torque_Nm = continuous_torque_Nm;
  profile.thermal_time_s = thermal_time_s;
  return profile;
}

Wrench push(double force_N, double torque_Nm = 0.0) {
  return {{0.6 * force_N, 0.0, 0.8 * force_N}, {0.0, torque_Nm, 0.0}};
}

/// Returns a wrench at the current limit.
Wrench full(const ThermalModel& model, double share = 1.0) {
  return push(share * model.force_ceiling_N(), share * model.torque_ceiling_Nm());
}

}  // namespace

TEST_CASE("from cold, full force is reduced after -T ln(1 - (continuous / max)^2)", "[thermal]") {
  struct Case {
    double continuous_N, max_N, time_s;
  };
  for (const Case& c :
       {Case{4.0, 10.0, 20.0}, Case{2.7, 6.0, 20.0}, Case{1.0, 1.5, 100.0}, Case{3.0, 10.0, 2.0}}) {
    ThermalModel model(motors(c.continuous_N, 0.2, c.time_s), c.max_N, 0.5);
    double t = 0.0;
    for (; !model.folded_back() && t < 10.0 * c.time_s; t += kTick_s) {
      REQUIRE(model.force_ceiling_N() == c.max_N);  // the full maximum until then
      model.advance(push(c.max_N), kTick_s);
    }
    const double share = c.continuous_N / c.max_N;
    INFO(c.continuous_N << " of " << c.max_N << " N");
    CHECK(t == Approx(-c.time_s * std::log(1.0 - share * share)).margin(2.0 * kTick_s));
  }
}

TEST_CASE("the heat is the first-order response to a constant force", "[thermal]") {
  for (const double force_N : {0.5, 2.0, 3.9}) {
    ThermalModel model(motors(), 10.0, 0.5);
    const double final_heat = force_N * force_N / 16.0;
    for (int tick = 1; tick <= 40'000; ++tick) {
      model.advance(push(force_N), kTick_s);
      if (tick % 10'000 == 0)
        CHECK(model.force_heat() == Approx(final_heat * -std::expm1(-tick * kTick_s / 20.0)).epsilon(1e-9));
    }
    CHECK_FALSE(model.folded_back());
    CHECK(model.force_ceiling_N() == 10.0);
    CHECK(model.torque_heat() == 0.0);
  }
}

TEST_CASE("the heat does not depend on the time step", "[thermal]") {
  ThermalModel fine(motors(), 10.0, 0.5), coarse(motors(), 10.0, 0.5);
  for (int tick = 0; tick < 2'000; ++tick) fine.advance(push(8.0, 0.4), kTick_s);
  for (int step = 0; step < 2; ++step) coarse.advance(push(8.0, 0.4), 1.0);
  CHECK(coarse.force_heat() == Approx(fine.force_heat()).epsilon(1e-9));
  CHECK(coarse.torque_heat() == Approx(fine.torque_heat()).epsilon(1e-9));
}

TEST_CASE("force and torque heat separate motors", "[thermal]") {
  ThermalModel model(motors(), 10.0, 0.5);
  for (int tick = 0; tick < 10'000; ++tick) model.advance(push(0.0, model.torque_ceiling_Nm()), kTick_s);
  CHECK(model.folded_back());
  CHECK(model.torque_ceiling_Nm() == 0.2);
  CHECK(model.force_ceiling_N() == 10.0);
  CHECK(model.force_heat() == 0.0);
}

TEST_CASE("under full demand the limit decreases continuously to the rating", "[thermal]") {
  ThermalModel model(motors(), 10.0, 0.5);
  const LimitSettings settings;
  double before_N = model.force_ceiling_N(), before_Nm = model.torque_ceiling_Nm();
  int folds = 0;
  bool folded = false;
  for (int tick = 0; tick < 300'000; ++tick) {
    model.advance(full(model), kTick_s);
    REQUIRE(std::abs(model.force_ceiling_N() - before_N) <= settings.force_slew_N_per_s * kTick_s);
    REQUIRE(std::abs(model.torque_ceiling_Nm() - before_Nm) <= settings.torque_slew_Nm_per_s * kTick_s);
    folds += model.folded_back() && !folded ? 1 : 0;
    folded = model.folded_back();
    before_N = model.force_ceiling_N();
    before_Nm = model.torque_ceiling_Nm();
  }
  CHECK(folds == 1);  // the limit does not chatter
  CHECK(model.folded_back());
  CHECK(model.force_ceiling_N() == 4.0);
  CHECK(model.torque_ceiling_Nm() == 0.2);
  CHECK(model.force_heat() == Approx(1.0).margin(1e-3));
}

TEST_CASE("without force it cools for T ln(1 / 0.8) and returns continuously to the maximum", "[thermal]") {
  ThermalModel model(motors(), 10.0, 0.5);
  for (int tick = 0; tick < 300'000; ++tick) model.advance(full(model), kTick_s);
  const double heat = model.force_heat();
  double t = 0.0;
  for (; model.folded_back() && t < 60.0; t += kTick_s) {
    REQUIRE(model.force_ceiling_N() == 4.0);
    model.advance(Wrench{}, kTick_s);
  }
  CHECK(t == Approx(20.0 * std::log(heat / MotorGroupHeat::kRecoveryHeat)).margin(2.0 * kTick_s));
  double before_N = 4.0;
  REQUIRE(model.force_ceiling_N() < 4.1);
  for (int tick = 0; tick < 1'000; ++tick) {
    model.advance(Wrench{}, kTick_s);
    REQUIRE(model.force_ceiling_N() >= before_N);
    REQUIRE(model.force_ceiling_N() - before_N <= 0.1);
    before_N = model.force_ceiling_N();
  }
  CHECK(model.force_ceiling_N() == 10.0);
}

TEST_CASE("no duty cycle heats any motor above 1.05 of its rating", "[thermal]") {
  constexpr std::uint64_t kSeed = 11;
  RandomValues random(kSeed);
  double hottest = 0.0;
  int folded = 0;
  for (int device = 0; device < 300; ++device) {
    const double max_N = random.log_uniform(0.1, 200.0), max_Nm = random.log_uniform(0.01, 20.0);
    DeviceProfile profile = motors(max_N * random.log_uniform(0.02, 1.0),
                                   max_Nm * random.log_uniform(0.02, 1.0), random.log_uniform(0.1, 20.0));
    ThermalModel model(profile, max_N, max_Nm);
    double share = 1.0;
    bool seen = false;
    for (int tick = 0; tick < 20'000; ++tick) {
      if (random.chance(device % 3 == 0 ? 0.0 : device % 3 == 1 ? 0.001 : 0.1))
        share = random.chance(0.5) ? 1.0 : 0.0;
      if (device % 7 == 6) share = random.uniform(0.0, 1.0);
      const double dt_s = device % 5 == 4 ? random.log_uniform(1e-6, kMaxStep_s) : kTick_s;
      const Wrench F = full(model, share);
      model.advance(F, dt_s);
      if (!(model.force_heat() <= 1.05) || !(model.torque_heat() <= 1.05))
        FAIL("seed " << kSeed << " device " << device << " tick " << tick << ": heat " << model.force_heat()
                     << " " << model.torque_heat());
      hottest = std::max({hottest, model.force_heat(), model.torque_heat()});
      seen = seen || model.folded_back();
      if (!(model.force_ceiling_N() <= max_N) || !(model.torque_ceiling_Nm() <= max_Nm))
        FAIL("above the maximum");
    }
    folded += seen ? 1 : 0;
  }
  INFO("hottest " << hottest << ", folded back " << folded);
  CHECK(hottest > 1.0);
  CHECK(folded > 100);
}

TEST_CASE("motors without a rating below their maximum always have the maximum", "[thermal]") {
  const double none = DeviceProfile::kNotStated;
  for (const DeviceProfile& profile :
       {motors(none, none, none), motors(none, 0.2, 20.0), motors(10.0, 0.5, 20.0), motors(4.0, 0.2, none),
        motors(4.0, 0.2, 0.0), motors(-4.0, 0.2, 20.0),
        motors(std::numeric_limits<double>::infinity(), 0.2, 20.0)}) {
    ThermalModel model(profile, 10.0, 0.5);
    for (int tick = 0; tick < 1'000; ++tick) {
      model.advance(push(10.0), 1.0);
      REQUIRE(model.force_ceiling_N() == 10.0);
      REQUIRE_FALSE(model.folded_back());
    }
  }
  ThermalModel tightened(motors(), 3.0, 0.5);  // the configured maximum is below the rating
  for (int tick = 0; tick < 100; ++tick) tightened.advance(push(3.0), 1.0);
  CHECK(tightened.force_ceiling_N() == 3.0);
  CHECK_FALSE(tightened.folded_back());
}

TEST_CASE("an invalid time step adds no heat, and a force that is not a number counts as the maximum",
          "[thermal]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  ThermalModel model(motors(), 10.0, 0.5);
  for (const double dt_s : {0.0, -0.0, -1.0, nan, inf, -inf}) model.advance(push(10.0, 0.5), dt_s);
  CHECK(model.force_heat() == 0.0);
  CHECK(model.force_ceiling_N() == 10.0);
  for (const double bad : {nan, inf, 50.0, 1e100, 1e200, 1e308}) {
    ThermalModel same(motors(), 10.0, 0.5), disturbed(motors(), 10.0, 0.5);
    for (int tick = 0; tick < 100; ++tick) {
      same.advance(push(10.0), kTick_s);
      disturbed.advance({{bad, 0.0, 0.0}, {0.0, 0.0, 0.0}}, kTick_s);
    }
    CHECK(disturbed.force_heat() == Approx(same.force_heat()).epsilon(1e-12));
  }
  model.advance(push(10.0), 1e300);  // a very long time at full force: maximum heat, limit at the rating
  CHECK(model.force_heat() == Approx(6.25));
  CHECK(model.folded_back());
  CHECK(model.force_ceiling_N() == 4.0);
  for (int tick = 0; tick < 60'000; ++tick) model.advance(Wrench{}, kTick_s);
  CHECK(model.force_ceiling_N() == 10.0);
}

TEST_CASE("heat and limits together: the wrench follows the limit, with the cause, without allocation",
          "[thermal][limits]") {
  const DeviceProfile profile = motors();
  WrenchLimits limits({}, profile);
  ThermalModel model(profile, limits.max_force_N(), limits.max_torque_Nm());
  Limited out;
  std::uint64_t allocations = 0, locks = 0;
  {
    const test::RealtimeGuard guard;
    for (int tick = 0; tick < 20'000; ++tick) {
      limits.set_ceiling(model.force_ceiling_N(), model.torque_ceiling_Nm());
      out = limits.apply({push(30.0), 1.0, kTick_s, Twist{}, Vector3d::Zero()});
      model.advance(out.F, kTick_s);
    }
    allocations = guard.allocations();
    locks = guard.locks();
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
  CHECK(out.F.force_N.norm() == Approx(4.0).epsilon(1e-12));
  CHECK(out.causes == (kForceMagnitude | kForceThermal));
}

}  // namespace wrenchd::test_thermal
