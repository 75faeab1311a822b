// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/conformance/reported_velocity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include <spdlog/fmt/fmt.h>

namespace wrenchd {
namespace {

/// Long enough that an encoder step of 100 um is 5 mm/s, and far below the duration of a hand's motion.
constexpr double kWindow_s = 0.020;
/// A window with a longer gap between two samples is not used.
constexpr double kMaxGap_s = 0.010;

/// Path length for the motion by pulses. It is at least kTravelPerStep steps of the numbers.
constexpr Travel kTravelByPulses = {0.0005, 0.005};
constexpr double kTravelPerStep = 20.0;
/// Slope of the reported over the differenced velocity.
constexpr double kMinSlope = 0.7, kMaxSlope = 1.3;
/// Below this slope the reported velocity counts as zero.
constexpr double kZeroSlope = 0.1;
constexpr double kMaxResidual = 0.35;
/// Correlation above which two velocities agree.
constexpr double kAgree = 0.9;

/// Sums over all windows: r reported, d differenced.
struct Sums {
  double rr = 0.0, dd = 0.0, rd = 0.0, travel = 0.0;

  void add(double r, double d, double time_s) {
    rr += r * r, dd += d * d, rd += r * d;
    travel += std::abs(d) * time_s;
  }
  VelocityAgreement agreement() const {
    if (dd <= 0.0) return {travel, 0.0, 0.0};
    const double slope = rd / dd;
    return {travel, slope, std::sqrt(std::max(rr - slope * rd, 0.0) / dd)};
  }
};

/// Sums for the correlation of two vectors.
struct Correlation {
  double rr = 0.0, dd = 0.0, rd = 0.0;

  void add(const Vector3d& r, const Vector3d& d) {
    rr += r.squaredNorm(), dd += d.squaredNorm(), rd += r.dot(d);
  }
  double value() const { return rr > 1e-4 * dd && dd > 0.0 ? rd / std::sqrt(rr * dd) : 0.0; }
};

/// The quaternion of a device that sends w x y z in the fields x y z w.
Quaterniond w_first(const Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

/// Mean of the reported velocity from sample a to sample b, by the trapezoidal rule.
Twist mean_velocity(std::span<const MotionSample> samples, std::size_t a, std::size_t b) {
  Twist sum;
  for (std::size_t i = a; i < b; ++i) {
    const double half_s = 0.5 * (samples[i + 1].time_s - samples[i].time_s);
    sum.linear_m_per_s += half_s * (samples[i].V_BH.linear_m_per_s + samples[i + 1].V_BH.linear_m_per_s);
    sum.angular_rad_per_s +=
        half_s * (samples[i].V_BH.angular_rad_per_s + samples[i + 1].V_BH.angular_rad_per_s);
  }
  const double duration_s = samples[b].time_s - samples[a].time_s;
  return {sum.linear_m_per_s / duration_s, sum.angular_rad_per_s / duration_s};
}

/// Returns the last sample of the window that starts at sample a; a itself if the window has a gap or is
/// incomplete.
std::size_t end_of_window(std::span<const MotionSample> samples, std::size_t a) {
  for (std::size_t b = a + 1; b < samples.size(); ++b) {
    const double step_s = samples[b].time_s - samples[b - 1].time_s;
    if (!(step_s > 0.0) || step_s > kMaxGap_s) return a;
    if (samples[b].time_s - samples[a].time_s >= kWindow_s) return b;
  }
  return a;
}

std::string velocity_error(const VelocityAgreement& axis) {
  if (axis.slope < -kMinSlope) return "the sign is inverted";
  if (std::abs(axis.slope) < kZeroSlope && axis.residual < kZeroSlope) return "it is zero";
  if (axis.slope < kMinSlope || axis.slope > kMaxSlope) return "the scale or the axis is wrong";
  if (axis.residual > kMaxResidual) return "it does not follow the motion";
  return {};
}

}  // namespace

Vector3d turn_between(const Quaterniond& from, const Quaterniond& to) {
  return rotation_vector((to.normalized() * from.normalized().conjugate()).normalized());
}

VelocityComparison compare_velocities(std::span<const MotionSample> samples) {
  std::array<Sums, 6> sums{};
  Correlation as_stated, swapped;
  VelocityComparison result;
  for (std::size_t a = 0; a < samples.size();) {
    const std::size_t b = end_of_window(samples, a);
    if (b == a) {
      ++a;
      continue;
    }
    const double duration_s = samples[b].time_s - samples[a].time_s;
    const Pose &X0 = samples[a].X_BH, &X1 = samples[b].X_BH;
    const Twist reported = mean_velocity(samples, a, b);
    const Vector3d v = (X1.translation_m - X0.translation_m) / duration_s;
    const Vector3d w = turn_between(X0.rotation, X1.rotation) / duration_s;
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      sums[axis].add(reported.linear_m_per_s[k], v[k], duration_s);
      sums[axis + 3].add(reported.angular_rad_per_s[k], w[k], duration_s);
    }
    as_stated.add(reported.angular_rad_per_s, w);
    swapped.add(reported.angular_rad_per_s,
                turn_between(w_first(X0.rotation), w_first(X1.rotation)) / duration_s);
    result.turned_rad += w.norm() * duration_s;
    a = b;
  }
  for (std::size_t i = 0; i < 6; ++i) result.axes[i] = sums[i].agreement();
  result.rotation_correlation = as_stated.value();
  result.w_first_correlation = swapped.value();
  return result;
}

Travel least_travel_by_pulses(double step_m, double step_rad) noexcept {
  return {std::max(kTravelByPulses.m, kTravelPerStep * step_m),
          std::max(kTravelByPulses.rad, kTravelPerStep * step_rad)};
}

RuleFinding judge_quaternion_order(const VelocityComparison& seen) {
  const double stated = seen.rotation_correlation, swapped = seen.w_first_correlation;
  if (seen.turned_rad < kMinTurn_rad) return {Judgement::not_judged, "the handle was not turned"};
  if (stated == 0.0 && swapped == 0.0) return {Judgement::not_judged, "the reported angular velocity is 0"};
  if (stated < kAgree && swapped > kAgree)
    return {Judgement::fail, "the angular velocity agrees with w x y z, and not with x y z w"};
  if (std::abs(stated) > kAgree) return {Judgement::pass, "x y z w, by the angular velocity"};
  return {Judgement::not_judged, "the angular velocity agrees with no order"};
}

RuleFinding judge_velocity(const VelocityComparison& seen, DofMask axes, const Travel& enough) {
  std::string wrong, right, unmoved;
  for (std::size_t i = 0; i < 6; ++i) {
    if ((axes >> i & 1U) == 0) continue;
    const VelocityAgreement& axis = seen.axes[i];
    const char* name = kAxisNames[i % 3];
    if (axis.travel < enough.of(i)) {
      unmoved += fmt::format(" {}", name);
      continue;
    }
    const std::string error = velocity_error(axis);
    std::string& list = error.empty() ? right : wrong;
    if (!list.empty()) list += "; ";
    list += fmt::format("{}: {:.2f} times the differenced pose{}{}", name, axis.slope,
                        error.empty() ? "" : ", ", error);
  }
  if (!wrong.empty()) return {Judgement::fail, wrong};
  if (unmoved.empty()) return {Judgement::pass, right};
  std::string text = "the handle was not moved enough:" + unmoved;
  if (!right.empty()) text += ". " + right;
  return {Judgement::not_judged, text};
}

}  // namespace wrenchd
