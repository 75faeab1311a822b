// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "core/passivity.hpp"
#include "devices/simulation/simulated_handle.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_passivity {

using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;
constexpr DeviceDamping kDevice{0.5, 0.002};
constexpr DeviceDamping kFrictionless{0.0, 0.0};

PassivityLimits with_delay(std::size_t ticks) {
  PassivityLimits caps;
  caps.delay_ticks = ticks;
  return caps;
}

Pose at_x(double x_m) {
  return {Quaterniond::Identity(), {x_m, 0.0, 0.0}};
}
Wrench along_x(double f_N) {
  return {{f_N, 0.0, 0.0}, Vector3d::Zero()};
}

/// A handle that taps a wall at x < 0 with a delay of `delay` ticks, with or without a guard.
struct Tapped {
  double net_J = 0.0;       ///< largest energy of the motors minus the device's friction
  double injected_J = 0.0;  ///< largest energy that the guard computed
  double asked_N = 0.0;     ///< largest requested force
  bool acted = false;
  bool out_of_hand = false;
};
Tapped tap(double K_N_per_m, std::size_t delay, bool guarded, double speed_m_per_s) {
  constexpr int kSubsteps = 16;
  SimulationSettings s;
  s.viscous_friction_N_s_per_m = 0.5;
  s.viscous_friction_Nm_s_per_rad = 0.002;
  s.hand_stiffness_N_per_m = 20.0;
  s.hand_damping_N_s_per_m = 0.0;
  s.actuator_max_force_N = 1000.0;
  SimulatedHandle handle(s, at_x(1e-9), kTick_s / kSubsteps);
  for (int i = 0; handle.V_BH().linear_m_per_s.x() > -speed_m_per_s && i < 10000; ++i) {
    handle.step({at_x(-1000.0), {}}, {});  // an impact
    if (handle.X_BH().translation_m.x() < 0.0) handle.step({at_x(0.0), {}}, {});
  }
  PassivityGuard guard(kDevice, with_delay(delay));
  std::array<Wrench, 64> sent{};
  Tapped out;
  const SimulatedEnergy start = handle.energy();
  for (std::size_t tick = 0; tick < 300; ++tick) {
    const double x_m = handle.X_BH().translation_m.x();
    Wrench F = along_x(x_m < 0.0 ? -K_N_per_m * x_m : 0.0);
    out.asked_N = std::max(out.asked_N, F.force_N.x());
    if (guarded) F = guard.limit(F, handle.X_BH(), tick == 0 ? 0.0 : kTick_s, x_m < 0.0);
    sent[tick % sent.size()] = F;
    const Wrench acting = tick < delay ? Wrench{} : sent[(tick - delay) % sent.size()];
    for (int i = 0; i < kSubsteps; ++i) {
      handle.step({at_x(0.0), {}}, acting);
      out.net_J = std::max(out.net_J, handle.energy().motors_J - start.motors_J -
                                          (handle.energy().friction_J - start.friction_J));
    }
    out.acted = out.acted || guard.intervened();
    out.injected_J = std::max(out.injected_J, guard.injected_J());
    out.out_of_hand = out.out_of_hand || guard.energy_runaway();
  }
  return out;
}

}  // namespace

TEST_CASE("the guard integrates the work of the wrench that acted", "[passivity]") {
  for (const std::size_t delay : {0u, 1u, 3u, 48u}) {
    INFO("delay " << delay);
    RandomValues random(21);
    PassivityGuard guard(kFrictionless, with_delay(delay));
    std::vector<Wrench> sent;
    Pose X;
    double in_J = 0.0, out_J = 0.0;
    guard.limit({}, X, 0.0, false);
    sent.emplace_back();
    for (int n = 0; n < 300; ++n) {
      const Vector3d way = random.vector<3>(1e-4), turn = random.vector<3>(1e-3);
      X.translation_m += way;
      X.rotation = (rotation_from(turn) * X.rotation).normalized();
      if (sent.size() > delay) {
        const Wrench& F = sent[sent.size() - 1 - delay];
        const double work_J = F.force_N.dot(way) + F.torque_Nm.dot(turn);
        (work_J > 0.0 ? out_J : in_J) += std::abs(work_J);
      }
      const Wrench asked = random.wrench();
      guard.limit(asked, X, kTick_s, false);
      // The guard must use the wrench after the limits.
      sent.push_back({0.5 * asked.force_N, 0.5 * asked.torque_Nm});
      guard.record_sent(sent.back());
    }
    CHECK(guard.energy_in_J() == Approx(in_J).epsilon(1e-6));
    CHECK(guard.energy_out_J() == Approx(out_J).epsilon(1e-6));
    CHECK(out_J > 0.0);
  }
}

TEST_CASE("the guard does not change a passive spring", "[passivity]") {
  PassivityGuard guard(kFrictionless, with_delay(0));
  constexpr double K = 500.0;
  double x = 0.0;
  for (int n = 0; n <= 2000; ++n) {
    // The mean force of each interval, so that the energy is exact up to rounding.
    const double next =
        -0.01 * std::sin(3.14159265358979 * (n + 1) / 1000.0) * std::sin(3.14159265358979 * (n + 1) / 1000.0);
    const Wrench asked = along_x(-0.5 * K * (x + next));
    const Wrench out = guard.limit(asked, at_x(x), n == 0 ? 0.0 : kTick_s, true);
    CHECK((out.force_N - asked.force_N).norm() <= 1e-9);
    x = next;
  }
  CHECK(guard.energy_in_J() == Approx(2.0 * 0.5 * K * 0.01 * 0.01).epsilon(1e-3));
  CHECK(guard.energy_out_J() == Approx(guard.energy_in_J()).epsilon(1e-6));
  CHECK(guard.injected_J() < 1e-9);
}

TEST_CASE("an active force is damped, then scaled to zero", "[passivity]") {
  PassivityGuard guard(kDevice, with_delay(0));
  double x = 0.0, scaling_end_J = 0.0;
  Wrench out;
  for (int n = 0; n < 500; ++n) {
    out = guard.limit(along_x(2.0), at_x(x), n == 0 ? 0.0 : kTick_s, true);
    if (out.force_N.x() > 0.0) x += 0.1 * kTick_s;  // the hand follows the force
    scaling_end_J = std::max(scaling_end_J, guard.injected_J());
  }
  CHECK(guard.intervened());
  CHECK(scaling_end_J > 0.5e-3);
  CHECK(scaling_end_J < 2.0e-3 + 2.0 * 0.1 * kTick_s);
  CHECK(out.force_N.norm() < 0.2);
  CHECK_FALSE(guard.energy_runaway());
}

TEST_CASE("energy absorbed in one contact gives no credit in the next, and a deficit remains",
          "[passivity]") {
  PassivityGuard guard(kFrictionless, with_delay(0));
  double x = 0.0;
  double dt_s = 0.0;
  const auto push = [&](double f_N, double step_m, bool contact) {
    const Wrench out = guard.limit(along_x(f_N), at_x(x), dt_s, contact);
    x += step_m;
    dt_s = kTick_s;
    return out;
  };
  for (int n = 0; n < 20; ++n) push(5.0, -1e-3, true);  // the hand does work of 0.1 J
  for (int n = 0; n < 3; ++n) push(0.0, 0.0, false);
  for (int n = 0; n < 4; ++n) push(1.0, 0.25e-3, true);
  push(0.0, 0.0, false);
  CHECK(guard.injected_J() > 0.5e-3);  // the guard counts it as generated
  const double debt_J = guard.injected_J();
  for (int n = 0; n < 3; ++n) push(0.0, 0.0, false);
  CHECK(guard.injected_J() <= debt_J);
  CHECK(guard.injected_J() > 0.99 * debt_J);
  CHECK(push(1.0, 0.0, true).force_N.x() < 1.0);
  guard.reset();
  dt_s = 0.0;
  CHECK(guard.injected_J() == 0.0);
  CHECK(push(1.0, 0.0, true).force_N.x() == 1.0);
}

TEST_CASE("with the guard a wall three times too stiff returns far less energy", "[passivity]") {
  // At a delay of 4 ms and 0.5 N.s/m the bound is 111 N/m.
  const Tapped bare = tap(333.0, 4, false, 0.5), guarded = tap(333.0, 4, true, 0.5);
  CHECK(bare.net_J > 3e-3);
  CHECK(guarded.net_J < bare.net_J / 3.0);
  CHECK(guarded.acted);
}

TEST_CASE("the guard does not change a wall within the stability bound", "[passivity]") {
  for (const double speed : {0.05, 0.2, 0.5}) {
    const Tapped tapped = tap(100.0, 4, true, speed);
    INFO("at " << speed << " m/s");
    CHECK(tapped.net_J <= 1e-9);
    CHECK(tapped.injected_J == 0.0);
    CHECK_FALSE(tapped.out_of_hand);
    CHECK(tapped.asked_N > 0.0);
  }
}

TEST_CASE("20 mJ generated within 100 ms are a fault, within 1 s they are not", "[passivity]") {
  for (const double watts : {0.4, 0.1}) {
    PassivityGuard guard(kFrictionless, with_delay(0));
    double x = 0.0;
    bool out_of_hand = false;
    for (int n = 0; n < 300; ++n) {
      guard.limit(along_x(1.0), at_x(x), n == 0 ? 0.0 : kTick_s, true);
      guard.record_sent(along_x(1.0));  // the unscaled force is sent nevertheless
      x += watts * kTick_s;
      out_of_hand = out_of_hand || guard.energy_runaway();
    }
    INFO(watts << " W");
    CHECK(out_of_hand == (watts > 0.2));
  }
}

TEST_CASE("releasing a compressed spring is not a fault", "[passivity]") {
  PassivityGuard guard(kDevice, with_delay(0));
  double x = 0.0;
  for (int n = 0; n < 100; ++n) {
    guard.limit(along_x(-1000.0 * x), at_x(x), n == 0 ? 0.0 : kTick_s, true);
    x -= 1e-4;
  }
  while (x < 0.0) {  // 50 mJ in 20 ms
    guard.limit(along_x(-1000.0 * x), at_x(x), kTick_s, true);
    CHECK_FALSE(guard.energy_runaway());
    x += 5e-4;
  }
  CHECK(guard.energy_out_J() > 40e-3);
}

TEST_CASE("the guard's damping exceeds neither the device's damping nor its maximum", "[passivity]") {
  for (const double cap : {1e9, 0.1, 0.0}) {
    PassivityLimits caps = with_delay(0);
    caps.damping_N_s_per_m = cap;
    caps.scaling_start_J = 1.0;  // damping only
    caps.scaling_end_J = 2.0;
    PassivityGuard guard(kDevice, caps);
    RandomValues random(22);
    double x = 0.0, last = 0.0, before = 0.0, most = 0.0;
    for (int n = 0; n < 200; ++n) {
      const Wrench out = guard.limit(along_x(3.0), at_x(x), n == 0 ? 0.0 : kTick_s, true);
      const double v = std::abs(x - before) / (2.0 * kTick_s);
      most = std::max(most, std::abs(out.force_N.x() - 3.0));
      if (n > 1) CHECK(std::abs(out.force_N.x() - 3.0) <= std::min(0.5, cap) * v + 1e-12);
      before = last;
      last = x;
      x += random.uniform(0.0, 1e-3);
    }
    CHECK((most > 0.0) == (cap > 0.0));
  }
}

TEST_CASE("the next sample makes up for a missed one", "[passivity]") {
  PassivityGuard guard(kFrictionless, with_delay(0));
  double x = 0.0;
  for (int n = 0; n < 100; ++n) {
    const bool fresh = n % 3 != 1;
    if (fresh)
      guard.limit(along_x(2.0), at_x(x), n == 0 ? 0.0 : (n % 3 == 2 ? 2.0 : 1.0) * kTick_s, false);
    else
      guard.limit(along_x(2.0), at_x(x - 1e-4), 0.0, false);
    x += 1e-4;
  }
  CHECK(guard.energy_out_J() == Approx(2.0 * 99e-4).epsilon(1e-9));
}

TEST_CASE("values that are not finite neither change the guard nor are hidden by it", "[passivity]") {
  PassivityGuard guard(kDevice, with_delay(0));
  guard.limit({}, at_x(0.0), 0.0, true);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::isnan(guard.limit(along_x(nan), at_x(0.0), kTick_s, true).force_N.x()));
  guard.record_sent(along_x(nan));
  guard.limit(along_x(1.0), at_x(nan), kTick_s, true);
  guard.limit(along_x(1.0), at_x(1e-3), nan, true);
  CHECK(guard.limit(along_x(1.0), at_x(0.0), kTick_s, true).force_N.x() == 1.0);
  CHECK(guard.energy_out_J() == 0.0);
}

TEST_CASE("the guard rejects invalid limits", "[passivity]") {
  const auto rejected = [](const std::function<void(PassivityLimits&)>& spoil) {
    PassivityLimits caps;
    spoil(caps);
    CHECK_THROWS_AS(PassivityGuard(kDevice, caps), std::invalid_argument);
  };
  rejected([](auto& c) { c.damping_N_s_per_m = -1.0; });
  rejected([](auto& c) { c.damping_Nm_s_per_rad = std::nan(""); });
  rejected([](auto& c) { c.scaling_end_J = c.scaling_start_J; });
  rejected([](auto& c) { c.scaling_start_J = -1.0; });
  rejected([](auto& c) { c.delay_ticks = PassivityGuard::kMaxDelay_ticks + 1; });
}

TEST_CASE("the guard allocates nothing", "[passivity][rt]") {
  PassivityGuard guard(kDevice, with_delay(3));
  RandomValues random(23);
  const test::RealtimeGuard realtime;
  for (int n = 0; n < 1000; ++n) {
    guard.limit(along_x(1.0), at_x(1e-4 * n), kTick_s, n % 10 != 0);
    guard.record_sent(along_x(0.5));
  }
  guard.reset();
  CHECK(realtime.allocations() + realtime.locks() == 0);
}

TEST_CASE("the wrench is scaled by the energy delivered and the energy under way, each counted once",
          "[passivity]") {
  for (const std::size_t delay : {0u, 1u, 4u}) {
    INFO("delay " << delay);
    PassivityLimits limits = with_delay(delay);
    limits.damping_N_s_per_m = limits.damping_Nm_s_per_rad = 0.0;  // scaling only
    PassivityGuard guard(kFrictionless, limits);
    constexpr double kForce_N = 1.0, kStep_m = 20e-6;
    double net_J = 0.0, least_scale = 1.0;
    for (std::size_t n = 0; n < 150; ++n) {
      const double x = kStep_m * static_cast<double>(n);
      guard.limit(along_x(kForce_N), at_x(x), n == 0 ? 0.0 : kTick_s, true);
      guard.record_sent(along_x(kForce_N));
      if (n > delay) net_J += kForce_N * kStep_m;  // the first wrench acts in the interval after the delay
      if (n > 0) net_J = std::max(net_J - PassivityGuard::kEnergyLeak_W * kTick_s, 0.0);
      if (n < 2) continue;  // the speed is known after two steps
      const double under_way_J = kForce_N * kStep_m * static_cast<double>(std::min(n, delay));
      const double share =
          (net_J + under_way_J - limits.scaling_start_J) / (limits.scaling_end_J - limits.scaling_start_J);
      CHECK(guard.scale() == Approx(1.0 - std::clamp(share, 0.0, 1.0)).margin(1e-9));
      least_scale = std::min(least_scale, guard.scale());
    }
    CHECK(least_scale == 0.0);
  }
}

TEST_CASE("the guard's damping dissipates the energy within a tick, in force and torque", "[passivity]") {
  PassivityLimits limits = with_delay(0);
  limits.scaling_start_J = 1.0;  // damping only
  limits.scaling_end_J = 2.0;
  for (const bool turning : {false, true}) {
    INFO((turning ? "turning" : "moving"));
    PassivityGuard guard(kDevice, limits);
    const double step = turning ? 1e-3 : 1e-4;  // in each tick of 1 ms: 1 rad/s or 0.1 m/s
    const Wrench push = turning ? Wrench{Vector3d::Zero(), {0.0, 0.01, 0.0}} : along_x(3.0);
    Wrench added;
    double energy_J = 0.0, alpha = 0.0;
    for (int n = 0; n < 20; ++n) {
      Pose X;
      if (turning)
        X.rotation = rotation_from(Vector3d(0.0, step * n, 0.0));
      else
        X.translation_m.x() = step * n;
      const Wrench out = guard.limit(push, X, n == 0 ? 0.0 : kTick_s, true);
      added = {out.force_N - push.force_N, out.torque_Nm - push.torque_Nm};
      energy_J = guard.injected_J();
      guard.record_sent(push);
      const double b = turning ? kDevice.angular_Nm_s_per_rad : kDevice.linear_N_s_per_m;
      const double speed = step / kTick_s;
      alpha = std::min(1.0, energy_J / (b * speed * speed * kTick_s));
      if (n < 2) continue;
      const double brake = turning ? added.torque_Nm.y() : added.force_N.x();
      CHECK(brake == Approx(-alpha * b * speed).epsilon(1e-6).margin(1e-12));
    }
    CHECK(alpha == 1.0);  // finally limited by the device's own friction
  }
}

TEST_CASE("generated energy decays by 1 mW, but not below zero", "[passivity]") {
  PassivityGuard guard(kFrictionless, with_delay(0));
  double x = 0.0;
  for (int n = 0; n < 5; ++n, x += 1e-4) {
    guard.limit(along_x(1.0), at_x(x), n == 0 ? 0.0 : kTick_s, true);
    guard.record_sent(along_x(1.0));
  }
  guard.limit({}, at_x(x - 1e-4), kTick_s, true);
  guard.record_sent({});
  const double start_J = guard.injected_J();
  CHECK(start_J > 0.3e-3);
  for (int n = 1; n <= 100; ++n) {
    guard.limit({}, at_x(x - 1e-4), kTick_s, true);
    guard.record_sent({});
    CHECK(guard.injected_J() == Approx(start_J - n * PassivityGuard::kEnergyLeak_W * kTick_s));
  }
  for (int n = 0; n < 1000; ++n) {
    guard.limit({}, at_x(x - 1e-4), kTick_s, true);
    guard.record_sent({});
  }
  CHECK(guard.injected_J() == 0.0);
}

TEST_CASE("work of moving obstacles: pushing adds credit; withdrawing removes it, but not below zero",
          "[passivity]") {
  PassivityGuard guard(kFrictionless, with_delay(0));
  double x = 0.0;
  const auto push = [&](double f_N, double step_m) {  // returns the generated energy
    guard.limit(along_x(f_N), at_x(x), kTick_s, true);
    guard.record_sent(along_x(f_N));
    x += step_m;
    guard.limit({}, at_x(x), kTick_s, true);
    guard.record_sent({});
    return guard.injected_J();
  };
  push(0.0, 0.0);
  guard.credit_obstacle_work(5e-3);
  CHECK(push(1.0, 4e-3) == 0.0);  // 4 mJ of the credit of 5 mJ
  guard.credit_obstacle_work(-0.5e-3);
  CHECK(push(1.0, 1e-3) == Approx(0.5e-3).epsilon(0.01));  // 0.5 mJ remained
  const double debt_J = guard.injected_J();
  guard.credit_obstacle_work(-1.0);
  CHECK(guard.injected_J() == debt_J);
  guard.credit(10e-3);
  CHECK(guard.injected_J() == 0.0);
  guard.credit_obstacle_work(-1.0);  // more than the credit: it becomes zero, not negative
  CHECK(guard.injected_J() == 0.0);
  CHECK(push(1.0, 1e-3) == Approx(1e-3).epsilon(0.01));
  guard.credit(-1.0);
  CHECK(push(0.0, 0.0) <= 1e-3);
}

}  // namespace wrenchd::test_passivity
