// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/simulated_firmware.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace wrenchd {
namespace {

/// Cut-off frequency of the first-order low pass on encoder differences. One quantum of 10 um at 8 kHz is a
/// spike of 80 mm/s; 100 Hz reduces it to 6 mm/s at a delay of 1.6 ms.
constexpr double kVelocityCutoff_Hz = 100.0;

Vector3d quantised(const Vector3d& v, double quantum) noexcept {
  if (quantum <= 0.0) return v;
  return {quantum * std::round(v.x() / quantum), quantum * std::round(v.y() / quantum),
          quantum * std::round(v.z() / quantum)};
}

double default_hold(const DeviceProfile& profile) noexcept {
  return profile.watchdog_s > 0.0 ? profile.watchdog_s : SimulatedFirmware::kMaxHold_s;
}

}  // namespace

SimulatedFirmware::SimulatedFirmware(const DeviceProfile& profile, const SimulationSettings& settings,
                                     Duration sample_period)
    : pose_layout_(profile.pose_report),
      wrench_layout_(profile.wrench_report),
      position_quantum_m_(settings.position_quantum_m),
      rotation_quantum_rad_(settings.rotation_quantum_rad),
      default_hold_s_(default_hold(profile)),
      sample_period_s_(seconds(sample_period)),
      filter_gain_(1.0 - std::exp(-2.0 * std::numbers::pi * kVelocityCutoff_Hz * sample_period_s_)) {}

SimulatedFirmware::Encoder SimulatedFirmware::read_encoders(const Pose& X_BH) const noexcept {
  return {quantised(X_BH.translation_m, position_quantum_m_),
          rotation_from(quantised(rotation_vector(X_BH.rotation), rotation_quantum_rad_))};
}

void SimulatedFirmware::initialize_encoders(const Pose& X_BH) noexcept {
  encoder_ = read_encoders(X_BH);
  V_BH_ = {};
}

//   V <- V + g (difference / T - V),   g = 1 - exp(-2 pi f_c T)
void SimulatedFirmware::sample(const Pose& X_BH) noexcept {
  const Encoder next = read_encoders(X_BH);
  const Vector3d v = (next.position_m - encoder_.position_m) / sample_period_s_;
  const Vector3d w = small_rotation_vector(next.rotation * encoder_.rotation.conjugate()) / sample_period_s_;
  V_BH_.linear_m_per_s += filter_gain_ * (v - V_BH_.linear_m_per_s);
  V_BH_.angular_rad_per_s += filter_gain_ * (w - V_BH_.angular_rad_per_s);
  encoder_ = next;
}

PoseReport SimulatedFirmware::make_report(Duration since_power_on) noexcept {
  PoseReport report;
  report.X_BH = {encoder_.rotation, encoder_.position_m};
  report.V_BH = V_BH_;
  report.sequence = ++sequence_;
  report.device_time =
      static_cast<std::uint64_t>(std::llround(seconds(since_power_on) / pose_layout_.device_time.step));
  report.acknowledged = last_command_.value_or(0);
  report.motors_on = motors_on_;
  report.watchdog_tripped = watchdog_tripped_;
  return report;
}

/// A repeated command is never accepted: a hanging host must not keep the motors on. A decreasing sequence is
/// accepted only while the motors are off, after a restart of the host.
bool SimulatedFirmware::in_order(std::uint64_t sequence) const noexcept {
  if (!wrench_layout_.sequence.present || !last_command_) return true;
  const unsigned bits = wrench_layout_.sequence.bits;
  const std::uint64_t half = std::uint64_t{1} << (bits - 1);
  const std::uint64_t ahead = (sequence - *last_command_) & (half + (half - 1));
  return ahead != 0 && (ahead < half || !motors_on_);
}

bool SimulatedFirmware::take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept {
  const auto [outcome, report] = decode(wrench_layout_, bytes);
  if (outcome != Decoding::ok || !in_order(report.sequence)) return false;
  const double hold_s = report.hold_time_s > 0.0 ? report.hold_time_s : default_hold_s_;
  hold_until_ = now + from_seconds(std::min(hold_s, kMaxHold_s));
  last_command_ = report.sequence;
  motors_on_ = report.enable;
  command_ = report.enable ? report.F : Wrench{};
  if (report.enable) watchdog_tripped_ = false;
  return true;
}

Wrench SimulatedFirmware::motor_wrench(TimePoint until) noexcept {
  if (watchdog_enabled_ && motors_on_ && until > hold_until_) trip_watchdog();
  return command_;
}

void SimulatedFirmware::trip_watchdog() noexcept {
  watchdog_tripped_ = watchdog_tripped_ || motors_on_;
  motors_on_ = false;
  command_ = {};
}

}  // namespace wrenchd
