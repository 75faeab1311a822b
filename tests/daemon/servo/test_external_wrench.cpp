// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "daemon/servo/external_wrench.hpp"
#include "tests/support/emulated_run.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_external_wrench {

namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

TimePoint after(double t_s) {
  return TimePoint(from_seconds(t_s));
}

ExternalWrenchRequest push(double z_N, double energy_J, TimePoint expires) {
  return {{{0.0, 0.0, z_N}, Vector3d::Zero()}, energy_J, expires};
}

/// The hand rests in free space.
RunConfig resting() {
  RunConfig config = shipped_config();
  config.settings.servo.self_test_s = 0.05;
  config.settings.limits.soft_start_s = 0.05;
  config.settings.simulation.hand_path = {{0.0, {0.0, 0.0, 0.08}, {0, 0, 0}}};
  config.settings.simulation.hand_repeats = false;
  return config;
}

/// A loop that is armed and active.
struct ActiveLoop : VirtualRuntime {
  explicit ActiveLoop(const RunConfig& config = resting()) : VirtualRuntime(config) {
    for (int k = 0; k < 1000 && state() != State::disarmed; ++k) tick();
    runtime.loop().requests().arm();
    for (int k = 0; k < 1000 && state() != State::active; ++k) tick();
    REQUIRE(state() == State::active);
  }
  void request(const ExternalWrenchRequest& request) {
    runtime.loop().requests().set_external_wrench(request);
  }
  TimePoint in(double t_s) { return clock.now() + from_seconds(t_s); }
  double motors_J() const { return simulated.handle().energy().motors_J; }
  double external_N() const {
    return Vector3d(last.F_external[0], last.F_external[1], last.F_external[2]).norm();
  }
};

}  // namespace

TEST_CASE("an external wrench follows its requests, and fades out after the last one", "[external_wrench]") {
  ExternalWrench external;
  CHECK_FALSE(external.advance(after(0.0), kTick_s).active);
  external.set(push(2.0, 0.25, after(0.1)));
  const auto first = external.advance(after(0.0), ExternalWrench::kTimeConstant_s);
  CHECK(first.active);
  CHECK(first.declared_J == 0.25);
  CHECK(first.F_H_W.force_N.z() == Approx(2.0 * (1.0 - std::exp(-1.0))));
  double last_N = first.F_H_W.force_N.z(), largest_fall_N = 0.0;
  for (int k = 1; k < 100; ++k) {
    const auto now = external.advance(after(k * kTick_s), kTick_s);
    CHECK(now.declared_J == 0.0);
    last_N = now.F_H_W.force_N.z();
  }
  CHECK(last_N == Approx(2.0));
  for (int k = 100; k < 160; ++k) {
    const auto now = external.advance(after(k * kTick_s), kTick_s);
    largest_fall_N = std::max(largest_fall_N, last_N - now.F_H_W.force_N.z());
    last_N = now.F_H_W.force_N.z();
    CHECK(now.active == (k < 149));
  }
  CHECK(last_N == 0.0);
  CHECK(largest_fall_N == Approx(2.0 / 50.0));
}

TEST_CASE("a request during the fade continues without a jump", "[external_wrench]") {
  ExternalWrench external;
  external.set(push(2.0, 0.1, after(0.05)));
  double last_N = 0.0, largest_N = 0.0;
  for (int k = 0; k < 300; ++k) {
    if (k == 75) external.set(push(-1.0, 0.1, after(1.0)));
    if (k == 80) external.set(push(-1.0, 0.2, after(1.0)));  // before the tick: energies add up
    if (k == 80) external.set(push(-1.0, 0.3, after(1.0)));
    const auto now = external.advance(after(k * kTick_s), kTick_s);
    if (k == 80) CHECK(now.declared_J == Approx(0.5));
    if (k > 20) largest_N = std::max(largest_N, std::abs(now.F_H_W.force_N.z() - last_N));
    last_N = now.F_H_W.force_N.z();
  }
  CHECK(last_N == Approx(-1.0));
  CHECK(largest_N < 2.0 * 0.2);  // a share of 1 - exp(-1 / 5) of what is left, from 1 N to -1 N
}

TEST_CASE("an external wrench reaches the hand with the energy that it declares", "[external_wrench]") {
  ActiveLoop run;
  run.request(push(3.0, 1.0, run.in(0.5)));
  const double before_m = run.simulated.X_BH().translation_m.z();
  run.run(0.3);
  CHECK(run.last.F_external[2] == Approx(3.0));
  CHECK(run.last.F_out[2] == Approx(3.0));
  CHECK(run.simulated.X_BH().translation_m.z() > before_m + 1e-3);
  CHECK(run.last.external_balance_J > 0.5);
  run.run(0.3);  // it has expired
  CHECK(run.external_N() == 0.0);
  CHECK(run.last.external_balance_J <= 0.0);
  CHECK(run.state() == State::active);
}

TEST_CASE("an external wrench without energy does not move the hand", "[external_wrench]") {
  ActiveLoop run;
  const double before_J = run.motors_J();
  for (int k = 0; k < 500; ++k) {
    run.request(push(k % 40 < 20 ? 5.0 : -5.0, 0.0, run.in(0.1)));
    run.tick();
    REQUIRE(run.external_N() == 0.0);
  }
  CHECK(run.motors_J() - before_J <= 1e-12);
}

TEST_CASE("on a device with a longer delay an external wrench needs a larger reserve", "[external_wrench]") {
  RunConfig slow = resting();
  slow.settings.simulation.command_delay_s = 0.010;
  const auto largest_N = [](const RunConfig& config) {
    ActiveLoop run(config);
    double most_N = 0.0;
    for (int k = 0; k < 60; ++k) {
      if (k == 0) run.request(push(4.0, 0.05, run.in(0.5)));
      run.tick();
      most_N = std::max(most_N, run.external_N());
    }
    return most_N;
  };
  const double fast_N = largest_N(resting()), slow_N = largest_N(slow);
  CHECK(fast_N > 1.5);
  CHECK(slow_N > 0.0);
  CHECK(slow_N < 0.5 * fast_N);  // the self-test has measured the delay
}

TEST_CASE("components without a motor are left out of an external wrench, and the record says which",
          "[external_wrench]") {
  // The hand moves to and fro above the table.
  EmulatedRun run(prescribed_motion(
      "polhem",
      [](double t_s) {
        return Pose{Quaterniond::Identity(), {0.02 * std::sin(t_s), 0.0, 0.08}};
      },
      4.0));
  run.run_until(0.5);
  run.arm();
  run.run_until(4.0, [&run] {
    run.runtime.loop().requests().set_external_wrench(
        {{{0.0, 0.0, 2.0}, {0.0, 0.1, 0.0}}, 0.1, run.clock.now() + from_seconds(0.1)});
    REQUIRE(run.record.F_external[4] == 0.0);
  });
  REQUIRE(run.state() == State::active);
  CHECK(run.record.F_external[2] > 1.0);
  CHECK(run.record.requested_external[4] == Approx(0.1));
  CHECK((run.record.undriven_dofs & (1U << 4U)) != 0);
}

TEST_CASE("the limits hold for the sum of contact and external wrench", "[external_wrench]") {
  RunConfig config = resting();
  config.settings.limits.max_force_N = 4.0;
  config.settings.limits.force_slew_N_per_s = 500.0;
  ActiveLoop run(config);
  double last_N = run.force_N(), largest_growth_N = 0.0;
  for (int k = 0; k < 400; ++k) {
    if (k % 50 == 0) run.request(push(k % 100 == 0 ? 9.0 : -9.0, 0.2, run.in(0.2)));
    run.tick();
    REQUIRE(run.force_N() <= 4.0 * (1.0 + 1e-12));
    largest_growth_N = std::max(largest_growth_N, run.force_N() - last_N);
    last_N = run.force_N();
  }
  CHECK(largest_growth_N <= 0.5 * (1.0 + 1e-9));
  CHECK(last_N > 1.0);
}

TEST_CASE("no external wrench reaches the hand while the loop is disarmed", "[external_wrench]") {
  VirtualRuntime run(resting());
  run.run(0.2);
  REQUIRE(run.state() == State::disarmed);
  for (int k = 0; k < 100; ++k) {
    run.runtime.loop().requests().set_external_wrench(push(5.0, 1.0, run.clock.now() + from_seconds(0.1)));
    run.tick();
    REQUIRE(run.force_N() == 0.0);
    REQUIRE(run.last.F_external[2] == 0.0);
  }
}

TEST_CASE("a stop ends an external wrench at once", "[external_wrench]") {
  ActiveLoop run;
  run.request(push(3.0, 1.0, run.in(1.0)));
  run.run(0.1);
  REQUIRE(run.external_N() > 2.9);
  run.runtime.loop().requests().stop();
  run.tick();
  CHECK(run.force_N() == 0.0);
  CHECK(run.external_N() == 0.0);
}

TEST_CASE("an external wrench acts beside the contact", "[external_wrench]") {
  RunConfig config = resting();
  config.settings.simulation.hand_path = {{0.0, {0.0, 0.0, 0.08}, {0, 0, 0}},
                                          {0.6, {0.0, 0.0, 0.08}, {0, 0, 0}},
                                          {0.8, {0.0, 0.0, 0.022}, {0, 0, 0}}};
  ActiveLoop alone(config), pushed(config);
  alone.run(1.0);
  REQUIRE(alone.last.contacts > 0);
  while (pushed.clock.now() < alone.clock.now()) {
    pushed.request({{{0.0, 0.5, 0.0}, Vector3d::Zero()}, 0.1, pushed.in(0.1)});
    pushed.tick();
  }
  CHECK(pushed.last.contacts > 0);
  CHECK(pushed.last.F_external[1] == Approx(0.5).epsilon(0.05));
  CHECK(pushed.last.F_out[2] > 0.5);  // the table pushes as well
  CHECK(std::abs(pushed.last.F_out[1] - alone.last.F_out[1]) > 0.2);
  CHECK(pushed.state() == State::active);
}

TEST_CASE("the loop allocates nothing for an external wrench", "[external_wrench]") {
  ActiveLoop run;
  const RealtimeGuard guard;
  for (int k = 0; k < 50; ++k) {
    run.request(push(1.0, 0.1, run.in(0.01)));
    run.tick();
  }
  const std::uint64_t allocations = guard.allocations(), locks = guard.locks();
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace wrenchd::test_external_wrench
