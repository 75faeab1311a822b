// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/conformance/reported_velocity.hpp"

namespace wrenchd::test_reported_velocity {

namespace {

using Catch::Contains;
using Samples = std::vector<MotionSample>;

/// A handle that oscillates along and about all axes for two seconds, with its exact velocity.
Samples moving_handle() {
  constexpr double kRate_rad_per_s = 12.0;
  const Vector3d amplitude_m(0.01, 0.02, 0.015);
  const Vector3d axis = Vector3d(0.3, -0.5, 0.8).normalized();
  Samples samples;
  for (double t_s = 0.0; t_s < 2.0; t_s += 0.001) {
    const double s = std::sin(kRate_rad_per_s * t_s), c = kRate_rad_per_s * std::cos(kRate_rad_per_s * t_s);
    samples.push_back(
        {t_s, {rotation_from(0.3 * s * axis), s * amplitude_m}, {c * amplitude_m, 0.3 * c * axis}});
  }
  return samples;
}

Samples changed(const std::function<void(MotionSample&)>& change) {
  Samples samples = moving_handle();
  std::for_each(samples.begin(), samples.end(), change);
  return samples;
}

constexpr Travel kEnough = {0.01, 0.1};

RuleFinding linear_of(const Samples& samples) {
  return judge_velocity(compare_velocities(samples), kLinearDofs, kEnough);
}
RuleFinding angular_of(const Samples& samples) {
  return judge_velocity(compare_velocities(samples), kAngularDofs, kEnough);
}

}  // namespace

TEST_CASE("a right velocity agrees with the differenced pose", "[reported_velocity]") {
  const VelocityComparison seen = compare_velocities(moving_handle());
  for (const VelocityAgreement& axis : seen.axes) {
    CHECK(axis.slope == Approx(1.0).margin(1e-3));
    CHECK(axis.residual < 0.01);
  }
  CHECK(linear_of(moving_handle()).judgement == Judgement::pass);
  CHECK(angular_of(moving_handle()).judgement == Judgement::pass);
  CHECK(judge_quaternion_order(seen).judgement == Judgement::pass);
}

TEST_CASE("a velocity that is inverted, zero, scaled or that of another axis is found wrong",
          "[reported_velocity]") {
  const auto inverted = [](MotionSample& s) { s.V_BH.linear_m_per_s.y() *= -1.0; };
  CHECK(linear_of(changed(inverted)).judgement == Judgement::fail);
  CHECK_THAT(linear_of(changed(inverted)).seen, Contains("y: -1.00") && Contains("the sign is inverted"));
  const auto zero = [](MotionSample& s) { s.V_BH.angular_rad_per_s.setZero(); };
  CHECK_THAT(angular_of(changed(zero)).seen, Contains("it is zero"));
  CHECK(linear_of(changed(zero)).judgement == Judgement::pass);
  const auto millimetres = [](MotionSample& s) { s.V_BH.linear_m_per_s *= 1000.0; };
  CHECK_THAT(linear_of(changed(millimetres)).seen, Contains("the scale or the axis is wrong"));
  const auto swapped = [](MotionSample& s) {
    std::swap(s.V_BH.linear_m_per_s.x(), s.V_BH.linear_m_per_s.y());
  };
  CHECK(linear_of(changed(swapped)).judgement == Judgement::fail);
}

TEST_CASE("only the axes asked for are judged, and only if the handle moved along them",
          "[reported_velocity]") {
  const Samples still = changed([](MotionSample& s) {
    s.X_BH.translation_m.z() = s.V_BH.linear_m_per_s.z() = 0.0;
    s.V_BH.linear_m_per_s.x() *= 2.0;
  });
  const VelocityComparison seen = compare_velocities(still);
  CHECK(judge_velocity(seen, 0b010, kEnough).judgement == Judgement::pass);
  CHECK(judge_velocity(seen, 0b110, kEnough).judgement == Judgement::not_judged);
  CHECK_THAT(judge_velocity(seen, 0b110, kEnough).seen, Contains("not moved enough: z"));
  CHECK(judge_velocity(seen, 0b111, kEnough).judgement == Judgement::fail);
}

TEST_CASE("the order of the quaternion shows in the angular velocity", "[reported_velocity]") {
  const auto w_first = [](MotionSample& s) {
    const Quaterniond q = s.X_BH.rotation;
    s.X_BH.rotation.coeffs() << q.w(), q.x(), q.y(), q.z();  // x y z w read from w x y z
  };
  const RuleFinding finding = judge_quaternion_order(compare_velocities(changed(w_first)));
  CHECK(finding.judgement == Judgement::fail);
  CHECK_THAT(finding.seen, Contains("w x y z"));
  const auto still = [](MotionSample& s) { s.X_BH.rotation.setIdentity(); };
  CHECK(judge_quaternion_order(compare_velocities(changed(still))).judgement == Judgement::not_judged);
}

TEST_CASE("a gap between samples ends a window", "[reported_velocity]") {
  Samples sparse;
  const Samples all = moving_handle();
  for (std::size_t i = 0; i < all.size(); i += 15) sparse.push_back(all[i]);
  for (const VelocityAgreement& axis : compare_velocities(sparse).axes) CHECK(axis.travel == 0.0);
}

TEST_CASE("coarse numbers need a longer path", "[reported_velocity]") {
  CHECK(least_travel_by_pulses(0.0, 0.0).m == Approx(0.0005));
  CHECK(least_travel_by_pulses(1e-4, 1e-3).m == Approx(0.002));
  CHECK(least_travel_by_pulses(1e-4, 1e-3).rad == Approx(0.02));
}

}  // namespace wrenchd::test_reported_velocity
