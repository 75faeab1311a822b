// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include <catch2/catch.hpp>

#include "core/work_account.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_work_account {

namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

Pose at(const Vector3d& p_m) {
  return {Quaterniond::Identity(), p_m};
}
Wrench force(double x_N) {
  return {{x_N, 0.0, 0.0}, Vector3d::Zero()};
}

/// A handle that moves at random, with accelerations up to a share of those that the account assumes.
class RandomHandle {
 public:
  RandomHandle(RandomValues& random, double share) : random_(random), share_(share) {}

  void move() {
    if (random_.chance(0.02)) {
      a_m_per_s2_ =
          share_ * WorkAccount::kMaxAcceleration_m_per_s2 * random_.uniform(0.0, 1.0) * random_.unit<3>();
      a_rad_per_s2_ =
          share_ * WorkAccount::kMaxAcceleration_rad_per_s2 * random_.uniform(0.0, 1.0) * random_.unit<3>();
    }
    if (v_m_per_s_.norm() > 2.0) a_m_per_s2_ = -share_ * 50.0 * v_m_per_s_.normalized();
    if (w_rad_per_s_.norm() > 15.0) a_rad_per_s2_ = -share_ * 2000.0 * w_rad_per_s_.normalized();
    v_m_per_s_ += kTick_s * a_m_per_s2_;
    w_rad_per_s_ += kTick_s * a_rad_per_s2_;
    displacement_m_ = kTick_s * v_m_per_s_;
    turn_rad_ = kTick_s * w_rad_per_s_;
    X_BH_.translation_m += displacement_m_;
    X_BH_.rotation = (rotation_from(turn_rad_) * X_BH_.rotation).normalized();
  }
  const Pose& X_BH() const { return X_BH_; }
  /// Work of a wrench in the last move.
  double work_J(const Wrench& F) const { return F.force_N.dot(displacement_m_) + F.torque_Nm.dot(turn_rad_); }

 private:
  RandomValues& random_;
  double share_;
  Pose X_BH_;
  Vector3d v_m_per_s_ = Vector3d::Zero(), w_rad_per_s_ = Vector3d::Zero();
  Vector3d a_m_per_s2_ = Vector3d::Zero(), a_rad_per_s2_ = Vector3d::Zero();
  Vector3d displacement_m_ = Vector3d::Zero(), turn_rad_ = Vector3d::Zero();
};

/// Force or torque alone, or both.
Wrench random_wrench(RandomValues& random) {
  const int kind = static_cast<int>(random.integer(0, 2));
  return {(kind == 1 ? 0.0 : random.uniform(0.0, 10.0)) * random.unit<3>(),
          (kind == 0 ? 0.0 : random.uniform(0.0, 0.5)) * random.unit<3>()};
}

/// Pose as encoders report it.
Pose rounded(const Pose& X, const EncoderStep& step) {
  const auto to_step = [](const Vector3d& v, double one) {
    return one > 0.0 ? Vector3d((v / one).array().round() * one) : v;
  };
  return {rotation_from(to_step(rotation_vector(X.rotation), step.angular_rad)),
          to_step(X.translation_m, step.linear_m)};
}

struct Balance {
  double declared_J = 0.0;
  double delivered_J = 0.0;       ///< By the wrench that does the most work among those that may act.
  double largest_excess_J = 0.0;  ///< Given beyond declared, at the worst time.
};

/// A program that requests what it likes. Of the wrenches that are under way or act already, the one with the
/// most work acts.
Balance run_against_worst_delay(RandomValues& random, std::size_t delay_ticks, const EncoderStep& step,
                                double share) {
  WorkAccount account({delay_ticks, step});
  RandomHandle handle(random, share);
  std::deque<Wrench> under_way = {Wrench{}};
  Balance balance;
  Wrench requested;
  for (int k = 0; k < 3000; ++k) {
    handle.move();
    double most_J = handle.work_J(under_way.front());
    for (const Wrench& F : under_way) most_J = std::max(most_J, handle.work_J(F));
    balance.delivered_J += most_J;
    balance.largest_excess_J = std::max(balance.largest_excess_J, balance.delivered_J - balance.declared_J);
    if (random.chance(0.02)) {
      const double energy_J = random.uniform(0.0, 0.02);
      // The account holds at most its maximum.
      const double before_J = account.balance_J();
      account.deposit(energy_J);
      balance.declared_J += account.balance_J() - before_J;
    }
    if (random.chance(0.005)) requested = random_wrench(random);
    const Wrench F = account.permit(requested, rounded(handle.X_BH(), step), kTick_s, kTick_s);
    account.record_sent(F);
    under_way.push_front(F);
    if (under_way.size() > delay_ticks + 1) under_way.pop_back();
  }
  return balance;
}

}  // namespace

TEST_CASE("an external wrench gives no more energy than declared, at any delay", "[work_account]") {
  RandomValues random(11);
  double delivered_J = 0.0;
  for (int run = 0; run < 60; ++run) {
    const auto delay = static_cast<std::size_t>(random.integer(1, 8));
    const Balance balance = run_against_worst_delay(random, delay, {}, 1.0);
    INFO("run " << run << ", delay " << delay << ", declared " << balance.declared_J);
    CHECK(balance.largest_excess_J <= 1e-9);
    delivered_J = std::max(delivered_J, balance.delivered_J / balance.declared_J);
  }
  CHECK(delivered_J > 0.5);  // it uses what was declared
}

TEST_CASE("encoder steps give an external wrench no energy", "[work_account]") {
  RandomValues random(12);
  for (int run = 0; run < 40; ++run) {
    const EncoderStep step = {random.log_uniform(1e-6, 1e-4), random.log_uniform(1e-5, 1e-3)};
    const Balance balance = run_against_worst_delay(random, 4, step, 1.0);
    INFO("run " << run << ", step " << step.linear_m);
    CHECK(balance.largest_excess_J <= 1e-6);
  }
}

TEST_CASE("a program that knows the pose better than the encoders gains nothing", "[work_account]") {
  constexpr double kStep_m = 1e-4, kDeclared_J = 0.02;
  WorkAccount account({1, {kStep_m, 0.0}});
  account.deposit(kDeclared_J);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  double delivered_J = 0.0, x_m = 0.0;
  for (int k = 1; k <= 4000; ++k) {
    const double next_m = 0.49 * kStep_m * std::sin(0.05 * k);  // the reported position never changes
    const Wrench F = account.permit(force(next_m > x_m ? 10.0 : -10.0), at({0, 0, 0}), kTick_s, kTick_s);
    account.record_sent(F);
    delivered_J += F.force_N.x() * (next_m - x_m);
    x_m = next_m;
  }
  CHECK(delivered_J <= kDeclared_J);
  CHECK(delivered_J > 0.5 * kDeclared_J);
}

TEST_CASE("with energy in reserve the external wrench is as requested", "[work_account]") {
  WorkAccount account({3, {}});
  account.deposit(0.5);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  for (int k = 1; k <= 200; ++k) {
    const Wrench F = account.permit(force(5.0), at({0.3e-3 * k, 0, 0}), kTick_s, kTick_s);
    REQUIRE(F.force_N.x() == 5.0);
  }
  // 5 N over 0.3 mm a tick, from the tick after the first one.
  CHECK(account.balance_J() == Approx(0.5 - 199 * 5.0 * 0.3e-3));
}

TEST_CASE("what the hand does against an external wrench, the wrench may give back", "[work_account]") {
  WorkAccount account({2, {}});
  account.deposit(0.05);
  double x_m = 0.0;
  const auto push = [&](double step_m, int ticks) {
    for (int k = 0; k < ticks; ++k) account.permit(force(4.0), at({x_m += step_m, 0, 0}), kTick_s, kTick_s);
  };
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  push(0.0, 5);
  CHECK(account.balance_J() == Approx(0.05));
  push(-0.2e-3, 100);
  CHECK(account.balance_J() == Approx(0.05 + 100 * 4.0 * 0.2e-3));
  push(0.2e-3, 100);
  CHECK(account.balance_J() == Approx(0.05));
  push(-1e-3, 400);
  CHECK(account.balance_J() == WorkAccount::kMaxBalance_J);
}

TEST_CASE("without energy an external wrench falls smoothly to zero", "[work_account]") {
  WorkAccount account({3, {}});
  account.deposit(0.02);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  double last_N = 0.0, largest_step_N = 0.0, smallest_J = 1.0;
  for (int k = 1; k <= 2000; ++k) {
    const double now_N = account.permit(force(3.0), at({0.2e-3 * k, 0, 0}), kTick_s, kTick_s).force_N.x();
    if (k > 1) largest_step_N = std::max(largest_step_N, std::abs(now_N - last_N));
    last_N = now_N;
    smallest_J = std::min(smallest_J, account.balance_J());
  }
  CHECK(smallest_J >= 0.0);
  CHECK(last_N < 1e-6);
  CHECK(largest_step_N < 0.25);
}

TEST_CASE("the balance pays for wrenches that are under way when the request ends", "[work_account]") {
  WorkAccount account({3, {}});
  account.deposit(0.5);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  account.permit(force(2.0), at({0, 0, 0}), kTick_s, kTick_s);
  for (int k = 1; k <= 8; ++k) {
    account.permit({}, at({1e-4 * k, 0, 0}), kTick_s, kTick_s);
    account.close();
    CHECK(account.balance_J() >= 0.0);
  }
  CHECK(account.balance_J() == 0.0);
}

TEST_CASE("an account ends with its wrench, and a debt stays", "[work_account]") {
  WorkAccount account({2, {}});
  account.deposit(0.3);
  account.close();
  CHECK(account.balance_J() == 0.0);
  account.deposit(5.0);
  CHECK(account.balance_J() == WorkAccount::kMaxBalance_J);
  account.deposit(-1.0);
  account.deposit(std::numeric_limits<double>::quiet_NaN());
  CHECK(account.balance_J() == WorkAccount::kMaxBalance_J);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  account.permit(force(10.0), at({0, 0, 0}), kTick_s, kTick_s);
  account.permit(force(10.0), at({0.3, 0, 0}), kTick_s, kTick_s);  // as no hand can
  CHECK(account.balance_J() == Approx(1.0 - 3.0));
  CHECK(account.permit(force(10.0), at({0.3, 0, 0}), kTick_s, kTick_s).force_N.norm() == 0.0);
  account.close();
  CHECK(account.balance_J() == Approx(-2.0));
  account.reset();
  CHECK(account.balance_J() == 0.0);
}

TEST_CASE("an account survives numbers that are not finite", "[work_account]") {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  WorkAccount account;
  account.deposit(1.0);
  account.permit({}, at({0, 0, 0}), 0.0, kTick_s);
  CHECK(account.permit(force(kNaN), at({0, 0, 0}), kTick_s, kTick_s).force_N.norm() == 0.0);
  CHECK(account.permit(force(1.0), at({kNaN, 0, 0}), kTick_s, kTick_s).force_N.norm() == 0.0);
  CHECK(account.permit(force(1.0), at({0, 0, 0}), kNaN, kTick_s).force_N.norm() == 0.0);
  CHECK(account.permit(force(1.0), at({0, 0, 0}), kTick_s, 0.0).force_N.norm() == 0.0);
  CHECK(account.permit(force(1.0), at({1e-4, 0, 0}), kTick_s, kTick_s).force_N.x() == 1.0);
}

TEST_CASE("an account does not allocate", "[work_account]") {
  const RealtimeGuard guard;
  WorkAccount account({4, {1e-5, 1e-4}});
  account.deposit(0.1);
  for (int k = 0; k < 100; ++k) account.permit(force(1.0), at({1e-5 * k, 0, 0}), kTick_s, kTick_s);
  account.record_sent(force(0.5));
  account.reset();
  const std::uint64_t allocations = guard.allocations(), locks = guard.locks();
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace wrenchd::test_work_account
