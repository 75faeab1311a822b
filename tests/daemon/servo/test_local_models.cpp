// SPDX-License-Identifier: GPL-3.0-or-later
#include <numbers>

#include <catch2/catch.hpp>

#include "daemon/servo/local_models.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd {
namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

LocalModel random_model(RandomValues& random, std::uint32_t id, TimePoint expires) {
  LocalModel model;
  model.id = id;
  model.kind = static_cast<LocalModel::Kind>(random.integer(0, 2));
  model.normal_W = random.unit<3>();
  model.offset_m = random.uniform(-0.1, 0.1);
  model.X_WA = random.pose(0.05);
  model.stiffness_N_per_m = random.uniform(0.0, 500.0);
  model.stiffness_Nm_per_rad = model.kind == LocalModel::Kind::spring ? random.uniform(0.0, 1.0) : 0.0;
  model.damping_N_s_per_m = random.uniform(0.0, 3.0);
  model.damping_Nm_s_per_rad = random.uniform(0.0, 0.01);
  model.expires = expires;
  return model;
}

Pose at(const Vector3d& p_m) {
  return {Quaterniond::Identity(), p_m};
}

TEST_CASE("a plane holds what is in it, and pulls at nothing", "[models]") {
  LocalModels models;
  LocalModel plane;
  plane.kind = LocalModel::Kind::plane;
  plane.stiffness_N_per_m = 100.0;
  plane.damping_N_s_per_m = 50.0;
  plane.expires = TimePoint(from_seconds(10.0));
  LocalModelSet set;
  set.add(plane);
  models.set_models(set);
  for (int i = 0; i < 100; ++i) models.evaluate(at({0, 0, 0.1}), {}, TimePoint{}, kTick_s, 1.0);
  CHECK(models.evaluate(at({0, 0, 0.1}), {{0, 0, -1}, {}}, TimePoint{}, kTick_s, 1.0).F_H_W.force_N.norm() ==
        0.0);
  const auto in = models.evaluate(at({1, 2, -0.02}), {{5, 0, 0}, {}}, TimePoint{}, kTick_s, 1.0);
  CHECK(in.F_H_W.force_N.isApprox(Vector3d(0, 0, 2.0)));
  CHECK(in.stored_energy_J == Approx(0.5 * 100.0 * 0.02 * 0.02));
  // Half of what it asks for, and it brakes whoever goes deeper, but holds nobody back who leaves.
  CHECK(models.evaluate(at({0, 0, -0.02}), {{0, 0, -0.1}, {}}, TimePoint{}, kTick_s, 0.5).F_H_W.force_N.z() ==
        Approx(0.5 * 7.0));
  CHECK(models.evaluate(at({0, 0, -0.02}), {{0, 0, 1.0}, {}}, TimePoint{}, kTick_s, 1.0).F_H_W.force_N.z() ==
        0.0);
}

TEST_CASE("models come and go over a twentieth of a second, and are gone by the time they expire",
          "[models]") {
  RandomValues random(8);
  for (int round = 0; round < 200; ++round) {
    LocalModels models;
    const double for_s = random.uniform(0.02, 0.3);
    LocalModelSet set;
    set.add(random_model(random, 1, TimePoint(from_seconds(for_s))));
    models.set_models(set);
    const Pose X_WH = at(random.vector<3>(0.05));
    const Twist V = random.velocity();
    Vector3d last = Vector3d::Zero();
    double most = 0.0, most_step = 0.0;
    for (int i = 1; i <= 400; ++i) {
      const auto felt = models.evaluate(X_WH, V, TimePoint(from_seconds(i * kTick_s)), kTick_s, 1.0);
      most = std::max(most, felt.F_H_W.force_N.norm());
      most_step = std::max(most_step, (felt.F_H_W.force_N - last).norm());
      last = felt.F_H_W.force_N;
      if (i * kTick_s > for_s + 1e-9) REQUIRE(last.norm() == 0.0);
    }
    const double whole = most / std::min(1.0, 0.5 * for_s / LocalModels::kFade_s);
    CHECK(most_step <= whole * kTick_s / LocalModels::kFade_s * 1.1 + 1e-12);
    if (for_s > 0.15 && set[0].kind == LocalModel::Kind::spring) CHECK(most > 0.0);
  }
}

// Whoever moves the handle around a closed way, with any models that stay as they are, gets nothing out of
// it.
TEST_CASE("no work is drawn from models around a closed way", "[models]") {
  RandomValues random(9);
  for (int round = 0; round < 50; ++round) {
    LocalModels models;
    LocalModelSet set;
    for (std::uint32_t id = 0; id < 5; ++id) set.add(random_model(random, id, TimePoint(from_seconds(1e6))));
    models.set_models(set);
    const Vector3d centre = random.vector<3>(0.03), a = random.vector<3>(0.05), b = random.vector<3>(0.05);
    const auto pose = [&](double phase) -> Pose {
      return at(centre + std::cos(phase) * a + std::sin(2.0 * phase) * b);
    };
    for (int i = 0; i < 100; ++i) models.evaluate(pose(0.0), {}, TimePoint{}, kTick_s, 1.0);
    double work_J = 0.0, effort_J = 0.0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) {
      const double step = 2.0 * std::numbers::pi / kSteps;
      const Vector3d way = pose((i + 1) * step).translation_m - pose(i * step).translation_m;
      const Twist V = {way / kTick_s, Vector3d::Zero()};
      const Wrench F = models.evaluate(pose((i + 0.5) * step), V, TimePoint{}, kTick_s, 1.0).F_H_W;
      work_J += F.force_N.dot(way);
      effort_J += std::abs(F.force_N.dot(way));
    }
    CHECK(work_J <= 1e-4 * effort_J);
  }
}

TEST_CASE("one that is said again goes on, one that is changed goes over, and no more than there is room for",
          "[models][realtime]") {
  LocalModels models;
  LocalModel spring;
  spring.kind = LocalModel::Kind::spring;
  spring.stiffness_N_per_m = 100.0;
  double last_N = 0.0, most_step_N = 0.0, least_N = 1e9;
  const RealtimeGuard guard;
  for (int i = 0; i < 2000; ++i) {
    const TimePoint now(from_seconds(i * kTick_s));
    if (i % 20 == 0) {  // said fifty times a second; from half the time on it moves each time
      spring.expires = now + from_seconds(0.1);
      if (i > 1000) spring.X_WA.translation_m.x() += 0.002;
      LocalModelSet set;
      set.add(spring);
      models.set_models(set);
    }
    const double force_N = models.evaluate(at({-0.1, 0, 0}), {}, now, kTick_s, 1.0).F_H_W.force_N.x();
    if (i > 60) most_step_N = std::max(most_step_N, std::abs(force_N - last_N));
    if (i > 60 && i < 1000) least_N = std::min(least_N, force_N);
    last_N = force_N;
  }
  const std::uint64_t allocations = guard.allocations(), locks = guard.locks();
  CHECK(least_N == Approx(10.0));
  CHECK(last_N > 19.0);
  CHECK(most_step_N < 0.05);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace
}  // namespace wrenchd
