// SPDX-License-Identifier: GPL-3.0-or-later
//
// Contact on an emulated Polhem, which senses six axes and drives three forces.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/energy_law.hpp"
#include "core/state_machine.hpp"
#include "tests/support/emulated_run.hpp"

namespace wrenchd {
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
  double given_J = 0.0, taken_J = 0.0;
  void add(double J) { (J > 0.0 ? given_J : taken_J) += std::abs(J); }
  double net_J() const { return given_J - taken_J; }
};

struct Result {
  Work sent;                 ///< of the sent force, in the rounds
  Work gradient;             ///< of the force at the measured pose, in the rounds
  double least_share = 1.0;  ///< least ratio of the two forces
  double least_scale = 1.0;  ///< of the passivity guard
  double largest_lag_rad = 0.0;
};

/// The force of the energy law at handle pose X_BH, without the account.
class MeasuredRendering {
 public:
  explicit MeasuredRendering(const RunConfig& config)
      : scene_(config.scene), k_per_s2_(config.settings.wrench.energy_stiffness_per_s2), depth_(scene_, {}) {}

  Vector3d force_N(const Pose& X_BH) {
    const Pose X_WP = X_BH * scene_.tool().X_MT();
    const Pose X_WQ = depth_.query(X_WP).projection.X_WQ;
    return X_WP.rotation * energy_wrench(scene_.tool().solid.inertia, k_per_s2_, X_WP, X_WQ).force_N;
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
  run.run_until(kLoopStart_s);
  REQUIRE(run.state() == State::active);
  Vector3d last_m = pose_from_numbers(run.record.X_BH).translation_m, sent_N = run.force_N();
  Vector3d gradient_N = measured.force_N(pose_from_numbers(run.record.X_BH));
  REQUIRE(sent_N.norm() > 1.0);
  run.run_until(kLoopStart_s + kRounds, [&] {
    const Pose X_BH = pose_from_numbers(run.record.X_BH);
    const Vector3d step_m = X_BH.translation_m - last_m, now_N = measured.force_N(X_BH);
    result.sent.add(0.5 * (sent_N + run.force_N()).dot(step_m));
    result.gradient.add(0.5 * (gradient_N + now_N).dot(step_m));
    last_m = X_BH.translation_m;
    sent_N = run.force_N();
    gradient_N = now_N;
    if (now_N.norm() > 0.2) result.least_share = std::min(result.least_share, sent_N.norm() / now_N.norm());
    result.least_scale = std::min(result.least_scale, run.record.passivity_scale);
    result.largest_lag_rad = std::max(result.largest_lag_rad, run.record.undriven_lag_rad);
  });
  std::printf(
      "sense %+.0f: gradient net %.3f mJ a round (out %.2f in %.2f), sent net %.3f mJ, least share %.3f, "
      "guard %.3f, lag %.3f rad\n",
      sense, 1e3 * result.gradient.net_J() / kRounds, 1e3 * result.gradient.given_J / kRounds,
      1e3 * result.gradient.taken_J / kRounds, 1e3 * result.sent.net_J() / kRounds, result.least_share,
      result.least_scale, result.largest_lag_rad);
  return result;
}

}  // namespace

TEST_CASE("a closed path of a hand that feels three forces gives no work, in either sense",
          "[undriven][servo]") {
  for (const double sense : {1.0, -1.0}) {
    INFO("sense " << sense);
    const Result r = go_round(sense);
    CHECK(r.sent.net_J() < 1e-6);
    CHECK(r.least_scale == 1.0);
    // METHOD (87b): the best that a passive device can do on this path.
    const double best = std::min(1.0, r.gradient.taken_J / r.gradient.given_J);
    CHECK(r.least_share > 0.9 * best);
  }
}

}  // namespace wrenchd
