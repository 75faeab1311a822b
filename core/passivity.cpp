// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/passivity.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

bool is_valid(double x) noexcept {
  return is_finite(x) && x >= 0.0;
}

double stated_or_zero(double b) noexcept {
  return is_valid(b) ? b : 0.0;
}

double capped_ratio(double limit, double b) noexcept {
  return b > 0.0 ? std::min(1.0, limit / b) : 0.0;
}

[[noreturn]] void reject_caps(const char* what) {
  throw std::invalid_argument(std::string("passivity guard: ") + what);
}

}  // namespace

PassivityGuard::PassivityGuard(const DeviceDamping& device, const PassivityLimits& caps)
    : device_{stated_or_zero(device.linear_N_s_per_m), stated_or_zero(device.angular_Nm_s_per_rad)},
      limits_(caps) {
  if (!is_valid(caps.damping_N_s_per_m) || !is_valid(caps.damping_Nm_s_per_rad))
    reject_caps("the caps on damping must be 0 or more");
  if (!is_valid(caps.scaling_start_J) || !is_valid(caps.scaling_end_J) ||
      caps.scaling_start_J >= caps.scaling_end_J)
    reject_caps("unseen_J must be 0 or more and below most_J");
  if (caps.delay_ticks > kMaxDelay_ticks) reject_caps("the delay is too long for a hand; shorten it");
  const double linear = capped_ratio(caps.damping_N_s_per_m, device_.linear_N_s_per_m);
  const double angular = capped_ratio(caps.damping_Nm_s_per_rad, device_.angular_Nm_s_per_rad);
  max_alpha_ = device_.angular_Nm_s_per_rad > 0.0 && device_.linear_N_s_per_m > 0.0
                   ? std::min(linear, angular)
                   : std::max(linear, angular);
}

void PassivityGuard::reset() noexcept {
  *this = PassivityGuard(device_, limits_);  // accepted by the constructor before
}

Wrench PassivityGuard::limit(const Wrench& asked_B, const Pose& X_BH, double dt_s, bool in_contact) noexcept {
  intervened_ = false;
  if (!is_finite(asked_B) || !is_finite(X_BH) || !is_finite(dt_s)) return asked_B;
  ++ticks_since_sample_;
  if (dt_s > 0.0 && has_pose_)
    observe({X_BH.translation_m - X_BH_.translation_m,
             small_rotation_vector(X_BH.rotation * X_BH_.rotation.conjugate()), dt_s});
  if (dt_s > 0.0 || !has_pose_) {
    X_BH_ = X_BH;
    has_pose_ = true;
    ticks_since_sample_ = 0;
  }
  if (!in_contact && no_wrench_pending()) net_J_ = std::max(net_J_, 0.0);
  if (net_J_ > 0.0) net_J_ = std::max(net_J_ - kEnergyLeak_W * std::max(dt_s, 0.0), 0.0);

  predicted_net_J_ = net_J_ + pending_work_J();

  Wrench out = asked_B;
  scale_ = 1.0;
  if (in_contact && predicted_net_J_ > 0.0) {
    scale_ = 1.0 - std::clamp((predicted_net_J_ - limits_.scaling_start_J) /
                                  (limits_.scaling_end_J - limits_.scaling_start_J),
                              0.0, 1.0);
    out = Wrench{scale_ * asked_B.force_N, scale_ * asked_B.torque_Nm} + damping_wrench(dt_s);
    intervened_ = true;
  }
  ++tick_;
  sent_[tick_ % kSentHistory] = out;
  return out;
}

void PassivityGuard::record_sent(const Wrench& sent_B) noexcept {
  sent_[tick_ % kSentHistory] = is_finite(sent_B) ? sent_B : Wrench{};
}

// METHOD (84)
//
//   E <- E + F . dx + tau . dtheta - (b |v|^2 + b_rot |w|^2) dt
void PassivityGuard::observe(const Motion& step) noexcept {
  Motion& oldest = motion_[++steps_ % kVelocityWindow];
  window_motion_.displacement_m += step.displacement_m - oldest.displacement_m;
  window_motion_.rotation_rad += step.rotation_rad - oldest.rotation_rad;
  window_motion_.dt_s += step.dt_s - oldest.dt_s;
  oldest = step;

  const Wrench F = acting_wrench();
  const double work_J = F.force_N.dot(step.displacement_m) + F.torque_Nm.dot(step.rotation_rad);
  (work_J > 0.0 ? energy_out_J_ : energy_in_J_) += std::abs(work_J);
  net_J_ += work_J - device_dissipation_J(step.dt_s);
  check_energy_runaway(step.dt_s);
}

/// Mean of the wrenches that acted since the previous sample, one per tick.
Wrench PassivityGuard::acting_wrench() const noexcept {
  const std::size_t ticks = std::clamp<std::size_t>(ticks_since_sample_, 1, kSentHistory - kMaxDelay_ticks);
  Wrench sum;
  for (std::size_t i = 0; i < ticks; ++i) {
    const std::uint64_t ago = limits_.delay_ticks + i;
    if (ago < kSentHistory && ago <= tick_) sum = sum + sent_[(tick_ - ago) % kSentHistory];
  }
  const double mean_factor = 1.0 / static_cast<double>(ticks);
  return {mean_factor * sum.force_N, mean_factor * sum.torque_Nm};
}

/// Work of the wrenches that were sent but have not acted in a sample yet, at the velocity of the last two
/// samples, METHOD (85).
double PassivityGuard::pending_work_J() const noexcept {
  const Motion& step = motion_[steps_ % kVelocityWindow];
  const Motion& before = motion_[(steps_ + kVelocityWindow - 1) % kVelocityWindow];
  const double span_s = step.dt_s + before.dt_s;
  if (!(span_s > 0.0)) return 0.0;
  const std::uint64_t ticks = std::min<std::uint64_t>(limits_.delay_ticks, tick_);
  Wrench sum;
  for (std::uint64_t i = 0; i < ticks; ++i) sum = sum + sent_[(tick_ - i) % kSentHistory];
  // Assumes one sample per tick.
  return 0.5 * (sum.force_N.dot(step.displacement_m + before.displacement_m) +
                sum.torque_Nm.dot(step.rotation_rad + before.rotation_rad));
}

/// Energy that the device's friction dissipates. |displacement|^2 / time of the window is at most the
/// integral of v^2 (Cauchy-Schwarz), so this never overestimates.
double PassivityGuard::device_dissipation_J(double dt_s) const noexcept {
  if (!(window_motion_.dt_s > 0.0)) return 0.0;
  const double rate_W = (device_.linear_N_s_per_m * window_motion_.displacement_m.squaredNorm() +
                         device_.angular_Nm_s_per_rad * window_motion_.rotation_rad.squaredNorm()) /
                        (window_motion_.dt_s * window_motion_.dt_s);
  return rate_W * dt_s;
}

/// True if all pending wrenches are zero.
bool PassivityGuard::no_wrench_pending() const noexcept {
  const std::uint64_t pending_ticks = std::min<std::uint64_t>(limits_.delay_ticks + 1, tick_);
  for (std::uint64_t i = 0; i < pending_ticks; ++i) {
    const Wrench& F = sent_[(tick_ - i) % kSentHistory];
    if (!F.force_N.isZero(0.0) || !F.torque_Nm.isZero(0.0)) return false;
  }
  return true;
}

/// Compares E with its minimum over the last kRunawayWindow_s.
void PassivityGuard::check_energy_runaway(double dt_s) noexcept {
  min_injected_J_[slice_] = std::min(min_injected_J_[slice_], injected_J());
  slice_time_s_ += dt_s;
  if (slice_time_s_ >= kRunawayWindow_s / static_cast<double>(kRunawaySlices)) {
    slice_time_s_ = 0.0;
    slice_ = (slice_ + 1) % kRunawaySlices;
    min_injected_J_[slice_] = injected_J();
  }
  energy_runaway_ =
      injected_J() - *std::min_element(min_injected_J_.begin(), min_injected_J_.end()) > kRunawayEnergy_J;
}

// METHOD (87)
//
//   F_guard = -alpha (b v, b_rot w),   alpha = E / ((b |v|^2 + b_rot |w|^2) dt)
Wrench PassivityGuard::damping_wrench(double dt_s) const noexcept {
  const Motion& step = motion_[steps_ % kVelocityWindow];
  const Motion& before = motion_[(steps_ + kVelocityWindow - 1) % kVelocityWindow];
  const double span_s = step.dt_s + before.dt_s;  // two samples halve the quantization noise of the velocity
  if (!(span_s > 0.0)) return {};
  const Vector3d f = device_.linear_N_s_per_m * (step.displacement_m + before.displacement_m) / span_s;
  const Vector3d t = device_.angular_Nm_s_per_rad * (step.rotation_rad + before.rotation_rad) / span_s;
  const double dissipated_J =
      (f.dot(step.displacement_m + before.displacement_m) + t.dot(step.rotation_rad + before.rotation_rad)) /
      span_s * (dt_s > 0.0 ? dt_s : step.dt_s);
  if (!(dissipated_J > 0.0)) return {};
  const double alpha = std::min(max_alpha_, predicted_net_J_ / dissipated_J);
  return {-alpha * f, -alpha * t};
}

}  // namespace wrenchd
