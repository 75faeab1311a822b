// SPDX-License-Identifier: GPL-3.0-or-later
#include <numbers>

#include <catch2/catch.hpp>

#include "daemon/servo/local_models.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_local_models {

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

/// A set of one model that is as it is for good, faded in completely.
LocalModels faded_in(const LocalModel& model, const Pose& X_WH) {
  LocalModels models;
  LocalModelSet set;
  set.add(model);
  models.set_models(set);
  for (int i = 0; i < 100; ++i) models.evaluate(X_WH, {}, TimePoint{}, kTick_s, 1.0);
  return models;
}

TEST_CASE("springs and damping fields oppose every motion, linear and angular, by their damping",
          "[models]") {
  RandomValues random(10);
  for (const LocalModel::Kind kind : {LocalModel::Kind::spring, LocalModel::Kind::damping})
    for (int round = 0; round < 20; ++round) {
      LocalModel model = random_model(random, 1, TimePoint(from_seconds(1e6)));
      model.kind = kind;
      model.damping_N_s_per_m = random.uniform(0.5, 3.0);
      model.damping_Nm_s_per_rad = random.uniform(0.001, 0.01);
      const Pose X_WH = random.pose(0.05);
      LocalModels models = faded_in(model, X_WH);
      const double share = random.uniform(0.2, 1.0);
      const Wrench rest = models.evaluate(X_WH, {}, TimePoint{}, kTick_s, share).F_H_W;
      const Twist V = {random.vector<3>(0.3), random.vector<3>(3.0)};
      const Wrench moved = models.evaluate(X_WH, V, TimePoint{}, kTick_s, share).F_H_W;
      CHECK((moved.force_N - rest.force_N).isApprox(-share * model.damping_N_s_per_m * V.linear_m_per_s));
      CHECK((moved.torque_Nm - rest.torque_Nm)
                .isApprox(-share * model.damping_Nm_s_per_rad * V.angular_rad_per_s));
      if (kind == LocalModel::Kind::damping) {
        CHECK(rest.force_N.norm() == 0.0);
        CHECK(rest.torque_Nm.norm() == 0.0);
      }
    }
}

TEST_CASE("a spring pulls towards its anchor, in translation and rotation, and holds half of k x^2",
          "[models]") {
  LocalModel spring;
  spring.kind = LocalModel::Kind::spring;
  spring.stiffness_N_per_m = 200.0;
  spring.stiffness_Nm_per_rad = 0.5;
  spring.X_WA = {rotation_from(Vector3d(0.0, 0.0, 0.3)), {0.01, 0.0, 0.0}};
  spring.expires = TimePoint(from_seconds(1e6));
  const Pose X_WH = {rotation_from(Vector3d(0.0, 0.0, 0.1)), {0.0, 0.02, 0.0}};
  LocalModels models = faded_in(spring, X_WH);
  for (const double share : {1.0, 0.25}) {
    const auto pulled = models.evaluate(X_WH, {}, TimePoint{}, kTick_s, share);
    CHECK(pulled.F_H_W.force_N.isApprox(share * 200.0 * Vector3d(0.01, -0.02, 0.0)));
    CHECK(pulled.F_H_W.torque_Nm.isApprox(share * 0.5 * Vector3d(0.0, 0.0, 0.2)));
    CHECK(pulled.stored_energy_J == Approx(share * (0.5 * 200.0 * 5e-4 + 0.5 * 0.5 * 0.04)));
    CHECK(pulled.crossfade_work_J == Approx(0.0).margin(1e-15));
    CHECK(pulled.any_active);
  }
}

TEST_CASE("what the springs hold after fading in at rest is what the fade gave them, and out of it again",
          "[models]") {
  RandomValues random(11);
  for (int round = 0; round < 50; ++round) {
    LocalModels models;
    LocalModelSet set;
    for (std::uint32_t id = 0; id < 3; ++id) set.add(random_model(random, id, TimePoint(from_seconds(1e6))));
    models.set_models(set);
    const Pose X_WH = random.pose(0.05);
    double delivered_J = 0.0, stored_J = 0.0, most_J = 0.0;
    for (int i = 0; i < 400; ++i) {
      if (i == 120) {  // two of them are moved elsewhere
        LocalModelSet moved;
        for (LocalModel model : set) {
          if (model.id < 2) model.X_WA = random.pose(0.05);
          moved.add(model);
        }
        models.set_models(moved);
      }
      if (i == 280) models.set_models({});
      const auto step = models.evaluate(X_WH, {}, TimePoint{}, kTick_s, 0.5);
      delivered_J += step.crossfade_work_J;
      stored_J = step.stored_energy_J;
      most_J = std::max(most_J, stored_J);
      REQUIRE(delivered_J == Approx(stored_J).margin(1e-12));
      CHECK(step.any_active == (i < 280 + 50));
    }
    CHECK(stored_J == 0.0);
    if (set[0].kind == LocalModel::Kind::spring) CHECK(most_J > 0.0);
  }
}

TEST_CASE("the gains of the models are added up while they act, and are gone with them", "[models]") {
  LocalModels models;
  LocalModel a, b;
  a.id = 1;
  a.kind = LocalModel::Kind::spring;
  a.stiffness_N_per_m = 100.0;
  a.stiffness_Nm_per_rad = 0.1;
  a.damping_N_s_per_m = 1.0;
  a.damping_Nm_s_per_rad = 0.001;
  a.expires = TimePoint(from_seconds(1e6));
  b = a;
  b.id = 2;
  b.stiffness_N_per_m = 20.0;
  b.stiffness_Nm_per_rad = 0.02;
  b.damping_N_s_per_m = 0.2;
  b.damping_Nm_s_per_rad = 0.0002;
  LocalModelSet set;
  set.add(a);
  set.add(b);
  models.set_models(set);
  CHECK(models.total_gains().stiffness_N_per_m == Approx(120.0));
  CHECK(models.total_gains().stiffness_Nm_per_rad == Approx(0.12));
  CHECK(models.total_gains().damping_N_s_per_m == Approx(1.2));
  CHECK(models.total_gains().damping_Nm_s_per_rad == Approx(0.0012));
  for (int i = 0; i < 60; ++i) models.evaluate({}, {}, TimePoint{}, kTick_s, 1.0);
  LocalModelSet one;
  one.add(b);
  models.set_models(one);
  for (int i = 0; i < 20; ++i) models.evaluate({}, {}, TimePoint{}, kTick_s, 1.0);
  CHECK(models.total_gains().stiffness_N_per_m == Approx(120.0));  // the one that goes still acts
  for (int i = 0; i < 40; ++i) models.evaluate({}, {}, TimePoint{}, kTick_s, 1.0);
  CHECK(models.total_gains().stiffness_N_per_m == Approx(20.0));
  CHECK(models.total_gains().damping_Nm_s_per_rad == Approx(0.0002));
  models.clear();
  CHECK(models.total_gains().stiffness_N_per_m == 0.0);
  CHECK_FALSE(models.evaluate({}, {}, TimePoint{}, kTick_s, 1.0).any_active);
}

TEST_CASE("a model that changes reaches its new values to 2 % within the fade, for each of its values",
          "[models]") {
  LocalModel old;
  old.kind = LocalModel::Kind::spring;
  old.stiffness_N_per_m = 100.0;
  old.stiffness_Nm_per_rad = 0.1;
  old.damping_N_s_per_m = 1.0;
  old.damping_Nm_s_per_rad = 0.002;
  old.X_WA = {Quaterniond::Identity(), {0.01, 0.0, 0.0}};
  old.expires = TimePoint(from_seconds(1e6));
  const Twist V = {{0.1, 0.2, 0.3}, {1.0, 2.0, 3.0}};
  const Pose X_WH = {rotation_from(Vector3d(0.2, 0.0, 0.0)), Vector3d::Zero()};
  const auto numbers = [&](LocalModels& models) {
    const Wrench F = models.evaluate(X_WH, V, TimePoint{}, kTick_s, 1.0).F_H_W;
    Vector6d all;
    all << F.force_N, F.torque_Nm;
    return all;
  };
  const auto changed = [&](const auto& change) {
    LocalModel next = old;
    change(next);
    LocalModels models = faded_in(old, X_WH), target = faded_in(next, X_WH);
    const Vector6d start = numbers(models), end = numbers(target);
    REQUIRE((end - start).norm() > 0.0);
    LocalModelSet set;
    set.add(next);
    models.set_models(set);
    Vector6d last = start;
    for (int i = 0; i < 50; ++i) {
      const Vector6d at = numbers(models);
      CHECK((at - last).norm() < 0.1 * (end - start).norm());  // nothing jumps
      last = at;
    }
    CHECK((last - end).norm() < 0.02 * (end - start).norm());
  };
  changed([](LocalModel& m) { m.stiffness_N_per_m = 300.0; });
  changed([](LocalModel& m) { m.stiffness_Nm_per_rad = 0.3; });
  changed([](LocalModel& m) { m.damping_N_s_per_m = 3.0; });
  changed([](LocalModel& m) { m.damping_Nm_s_per_rad = 0.01; });
  changed([](LocalModel& m) { m.X_WA.translation_m = {0.0, 0.03, 0.0}; });
  changed([](LocalModel& m) { m.X_WA.rotation = rotation_from(Vector3d(0.0, 0.2, 0.0)); });
  old.kind = LocalModel::Kind::plane;
  old.offset_m = 0.01;
  changed([](LocalModel& m) { m.offset_m = 0.03; });
  changed([](LocalModel& m) { m.normal_W = Vector3d(1.0, 0.0, 1.0).normalized(); });
}

TEST_CASE("when there is no room left, a new model takes the place of the one that has faded most",
          "[models]") {
  LocalModels models;
  LocalModelSet first, second, third;
  LocalModel model;
  model.kind = LocalModel::Kind::damping;
  model.damping_N_s_per_m = 1.0;
  model.expires = TimePoint(from_seconds(1e6));
  for (std::uint32_t id = 0; id < kMaxLocalModels; ++id) {
    model.id = id;
    first.add(model);
    model.id = id + 100;
    second.add(model);
    model.id = id + 200;
    third.add(model);
  }
  const Twist V = {{1.0, 0.0, 0.0}, {}};
  const auto brake_N = [&] { return -models.evaluate({}, V, TimePoint{}, kTick_s, 1.0).F_H_W.force_N.x(); };
  models.set_models(first);
  for (int i = 0; i < 60; ++i) brake_N();
  CHECK(brake_N() == Approx(8.0));
  models.set_models(second);
  for (int i = 0; i < 20; ++i) brake_N();  // the first have 0.6 left, the second have 0.4
  CHECK(brake_N() == Approx(8.0));
  models.set_models(third);  // all sixteen places are taken: the second, at 0.42, go at once
  CHECK(brake_N() == Approx(8.0 * (0.58 - 0.02 + 0.02)).epsilon(0.05));
  for (int i = 0; i < 60; ++i) brake_N();
  CHECK(brake_N() == Approx(8.0));
}

}  // namespace
}  // namespace wrenchd::test_local_models
