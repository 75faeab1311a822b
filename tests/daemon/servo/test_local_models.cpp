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

TEST_CASE("a plane pushes out of the solid and never pulls", "[models]") {
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
  // A scale of 0.5 halves spring and damper. The plane damps motion into the solid and never pulls back a
  // handle that leaves.
  CHECK(models.evaluate(at({0, 0, -0.02}), {{0, 0, -0.1}, {}}, TimePoint{}, kTick_s, 0.5).F_H_W.force_N.z() ==
        Approx(0.5 * 7.0));
  CHECK(models.evaluate(at({0, 0, -0.02}), {{0, 0, 1.0}, {}}, TimePoint{}, kTick_s, 1.0).F_H_W.force_N.z() ==
        0.0);
}

TEST_CASE("models fade in and out over 50 ms, and the fade ends at the expiry", "[models]") {
  RandomValues random(8);
  for (int round = 0; round < 200; ++round) {
    LocalModels models;
    const double lifetime_s = random.uniform(0.02, 0.3);
    LocalModelSet set;
    set.add(random_model(random, 1, TimePoint(from_seconds(lifetime_s))));
    models.set_models(set);
    const Pose X_WH = at(random.vector<3>(0.05));
    const Twist V = random.velocity();
    Vector3d last = Vector3d::Zero();
    double max_force = 0.0, max_step = 0.0;
    for (int i = 1; i <= 400; ++i) {
      const auto model = models.evaluate(X_WH, V, TimePoint(from_seconds(i * kTick_s)), kTick_s, 1.0);
      max_force = std::max(max_force, model.F_H_W.force_N.norm());
      max_step = std::max(max_step, (model.F_H_W.force_N - last).norm());
      last = model.F_H_W.force_N;
      if (i * kTick_s > lifetime_s + 1e-9) REQUIRE(last.norm() == 0.0);
    }
    const double full_force = max_force / std::min(1.0, 0.5 * lifetime_s / LocalModels::kFade_s);
    CHECK(max_step <= full_force * kTick_s / LocalModels::kFade_s * 1.1 + 1e-12);
    if (lifetime_s > 0.15 && set[0].kind == LocalModel::Kind::spring) CHECK(max_force > 0.0);
  }
}

// Passivity: a motion along a closed path among constant models extracts no energy.
TEST_CASE("a closed path among constant models extracts no work", "[models]") {
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
      const Vector3d step_m = pose((i + 1) * step).translation_m - pose(i * step).translation_m;
      const Twist V = {step_m / kTick_s, Vector3d::Zero()};
      const Wrench F = models.evaluate(pose((i + 0.5) * step), V, TimePoint{}, kTick_s, 1.0).F_H_W;
      work_J += F.force_N.dot(step_m);
      effort_J += std::abs(F.force_N.dot(step_m));
    }
    CHECK(work_J <= 1e-4 * effort_J);
  }
}

TEST_CASE("an update extends the lifetime, and a changed model is approached without a jump",
          "[models][realtime]") {
  LocalModels models;
  LocalModel spring;
  spring.kind = LocalModel::Kind::spring;
  spring.stiffness_N_per_m = 100.0;
  double last_N = 0.0, max_step_N = 0.0, min_N = 1e9;
  const RealtimeGuard guard;
  for (int i = 0; i < 2000; ++i) {
    const TimePoint now(from_seconds(i * kTick_s));
    if (i % 20 == 0) {  // 50 updates per second; in the second half each update moves the spring
      spring.expires = now + from_seconds(0.1);
      if (i > 1000) spring.X_WA.translation_m.x() += 0.002;
      LocalModelSet set;
      set.add(spring);
      models.set_models(set);
    }
    const double force_N = models.evaluate(at({-0.1, 0, 0}), {}, now, kTick_s, 1.0).F_H_W.force_N.x();
    if (i > 60) max_step_N = std::max(max_step_N, std::abs(force_N - last_N));
    if (i > 60 && i < 1000) min_N = std::min(min_N, force_N);
    last_N = force_N;
  }
  const std::uint64_t allocations = guard.allocations(), locks = guard.locks();
  CHECK(min_N == Approx(10.0));
  CHECK(last_N > 19.0);
  CHECK(max_step_N < 0.05);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace
}  // namespace wrenchd
