// SPDX-License-Identifier: GPL-3.0-or-later
//
// Contact on an emulated Polhem, which senses six axes and drives three forces.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/energy_law.hpp"
#include "core/state_machine.hpp"
#include "tests/support/emulated_run.hpp"

namespace wrenchd::test_undriven_rendering {

namespace {

using test::EmulatedRun;

constexpr double kLoopStart_s = 3.0;
constexpr double kRounds = 3.0;
constexpr double kTilt_rad = 0.3, kDepth_m = 0.006;

/// Rests above the table, tilts, comes down on an edge of the shipped cube, and goes round a closed path of 4
/// mm and 0.3 rad once a second. sense 1: the path on which the measured rotation would give energy.
Pose loop_motion(double t_s, double sense) {
  const auto ramp = [&](double from_s, double to_s) {
    const double x = std::clamp((t_s - from_s) / (to_s - from_s), 0.0, 1.0);
    return x * x * (3.0 - 2.0 * x);
  };
  const double angle = sense * 2.0 * std::numbers::pi * std::clamp(t_s - kLoopStart_s, 0.0, kRounds);
  const double height_m = 0.06 + ramp(1.5, 2.8) * (0.025 - kDepth_m + 0.002 - 0.06);
  const double tilt_rad = kTilt_rad * ramp(0.8, 1.4);
  return {rotation_from({0.0, tilt_rad + 0.15 * std::sin(angle), 0.0}),
          {0.0, 0.0, height_m - 0.002 * (1.0 - std::cos(angle))}};
}

/// Work of a force on the hand: given and taken.
struct Work {
  double delivered_J = 0.0, taken_J = 0.0;
  void add(double J) { (J > 0.0 ? delivered_J : taken_J) += std::abs(J); }
  double net_J() const { return delivered_J - taken_J; }
};

struct Result {
  Work sent;                 ///< work of the sent force during the rounds
  Work gradient;             ///< work of the force at the measured pose during the rounds
  double friction_J = 0.0;   ///< energy that the device's viscous friction dissipates during the rounds
  double least_share = 1.0;  ///< least ratio of the two forces
  /// Least ratio of the sent force to the largest one that is passive for every future motion, METHOD (87c).
  double least_of_possible = 1.0;
  double least_scale = 1.0;  ///< of the passivity guard
  double largest_lag_rad = 0.0;
};

/// The force of the energy law at handle pose X_BH, without the account.
class MeasuredRendering {
 public:
  explicit MeasuredRendering(const RunConfig& config)
      : scene_(config.scene), k_per_s2_(config.settings.wrench.energy_stiffness_per_s2), depth_(scene_, {}) {}

  struct Spring {
    Vector3d force_N;
    double U_J;
  };
  Spring at(const Pose& X_BH) {
    const Pose X_WP = X_BH * scene_.tool().X_MT();
    const Projection q = depth_.query(X_WP).projection;
    const Wrench F_T = energy_wrench(scene_.tool().solid.inertia, k_per_s2_, X_WP, q.X_WQ);
    return {X_WP.rotation * F_T.force_N, 0.5 * k_per_s2_ * q.energy};
  }

 private:
  Scene scene_;
  double k_per_s2_;
  PenetrationDepth depth_;
};

Result go_round(double sense) {
  RunConfig config = test::prescribed_motion(
      "polhem", [=](double t_s) { return loop_motion(t_s, sense); }, kLoopStart_s + kRounds + 0.5);
  config.settings.rendering.friction = {};
  MeasuredRendering measured(config);
  EmulatedRun run(config);
  Result result;
  run.run_until(0.5);
  run.arm();
  run.run_until(1.5);  // in free space
  Vector3d last_m = pose_from_numbers(run.record.X_BH).translation_m;
  Vector3d sent_N = Vector3d::Zero(), gradient_N = Vector3d::Zero();
  double put_in_J = 0.0;  // net work of the hand since the free space
  double time_s = 1.5;
  run.run_until(kLoopStart_s + kRounds, [&] {
    const Pose X_BH = pose_from_numbers(run.record.X_BH);
    const Vector3d step_m = X_BH.translation_m - last_m;
    const MeasuredRendering::Spring now = measured.at(X_BH);
    const double work_J = 0.5 * (sent_N + run.force_N()).dot(step_m);
    const double gradient_work_J = 0.5 * (gradient_N + now.force_N).dot(step_m);
    put_in_J -= work_J;
    last_m = X_BH.translation_m;
    sent_N = run.force_N();
    gradient_N = now.force_N;
    time_s += EmulatedRun::kPeriod_s;
    if (time_s < kLoopStart_s) return;
    result.sent.add(work_J);
    result.gradient.add(gradient_work_J);
    result.friction_J += config.profile.damping_N_s_per_m * step_m.squaredNorm() / EmulatedRun::kPeriod_s;
    const double share = sent_N.norm() / now.force_N.norm();
    const double possible = std::min(1.0, std::sqrt(std::max(put_in_J, 0.0) / now.U_J));
    result.least_share = std::min(result.least_share, share);
    result.least_of_possible = std::min(result.least_of_possible, share / possible);
    result.least_scale = std::min(result.least_scale, run.record.passivity_scale);
    result.largest_lag_rad = std::max(result.largest_lag_rad, run.record.undriven_lag_rad);
  });
  REQUIRE(run.state() == State::active);
  UNSCOPED_INFO("sense " << sense << ": force at the measured pose gives "
                         << 1e3 * result.gradient.net_J() / kRounds << " mJ a round, the sent force "
                         << 1e3 * result.sent.net_J() / kRounds << " mJ, friction takes "
                         << 1e3 * result.friction_J / kRounds << " mJ; least share of the former force "
                         << result.least_share << ", of the possible one " << result.least_of_possible
                         << ", largest lag " << result.largest_lag_rad << " rad");
  return result;
}

}  // namespace

TEST_CASE("a closed path of a hand that feels three forces gives no work, in either sense",
          "[undriven][servo]") {
  for (const double sense : {1.0, -1.0}) {
    INFO("sense " << sense);
    const Result r = go_round(sense);
    CHECK(r.sent.net_J() - r.friction_J < 1e-6);
    CHECK(r.least_scale == 1.0);
    CHECK(r.least_share > 0.7);
    CHECK(r.least_of_possible > 0.9);
    CHECK(std::abs(r.gradient.net_J() / kRounds) == Approx(1.8e-3).epsilon(0.05));
  }
}

}  // namespace wrenchd::test_undriven_rendering
