// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/firmware_in_hand.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace wrenchd::test {
namespace {

/// The 32-bit clock of the firmware wraps one second after power-on.
constexpr std::uint32_t kClockAtPowerOn_us = 0U - 1'000'000U;
/// Weight of a difference in the velocity estimate: 100 Hz at 125 us.
constexpr std::uint32_t kVelocityGain = 20;

double quantised(double value, double quantum) {
  return quantum > 0.0 ? quantum * std::round(value / quantum) : value;
}

Vector3d quantised(const Vector3d& v, double quantum) {
  return {quantised(v.x(), quantum), quantised(v.y(), quantum), quantised(v.z(), quantum)};
}

std::int32_t counts(double value, double step) {
  return static_cast<std::int32_t>(std::lround(value / step));
}

Vector3d vector(const std::int32_t (&values)[3]) {
  return 1e-6 * Vector3d(values[0], values[1], values[2]);
}

std::uint32_t micro(double value) {
  return static_cast<std::uint32_t>(std::lround(1e6 * value));
}

}  // namespace

void seal(std::span<std::uint8_t> report) {
  const std::size_t at = report.size() - 2;
  const std::uint16_t crc = wf_crc16(report.data(), at);
  report[at] = static_cast<std::uint8_t>(crc & 0xFF);
  report[at + 1] = static_cast<std::uint8_t>(crc >> 8);
}

FirmwareInHand::FirmwareInHand(const DeviceProfile& profile, const SimulationSettings& settings,
                               FirmwareMistakes mistakes)
    : substep_(from_seconds(1.0 / (profile.report_rate_Hz * static_cast<double>(kSubstepsPerReport)))),
      path_(settings),
      handle_(settings, path_.at(Duration{0}).X_BG, seconds(substep_)),
      position_quantum_m_(settings.position_quantum_m),
      rotation_quantum_rad_(settings.rotation_quantum_rad),
      mistakes_(std::move(mistakes)) {
  const wf_limits limits = {micro(settings.actuator_max_force_N), micro(settings.actuator_max_torque_Nm),
                            static_cast<std::uint16_t>(std::lround(1e3 * profile.watchdog_s))};
  wf_init(&firmware_, &limits);
  wf_velocity_init(&velocity_, micro(seconds(substep_) * static_cast<double>(kSubstepsPerSample)),
                   kVelocityGain);
  read_encoders();
}

std::uint32_t FirmwareInHand::clock_us() const noexcept {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(now_ - power_on_);
  return kClockAtPowerOn_us + static_cast<std::uint32_t>(since.count());
}

void FirmwareInHand::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = true;
    power_on_ = now_ = t;
    faults_.power_on(t);
  }
  while (now_ + substep_ <= t) substep(host);
}

void FirmwareInHand::substep(ReportSink& host) noexcept {
  now_ += substep_;
  wf_wrench wrench;
  wf_motor_wrench(&firmware_, mistakes_.motor_clock ? mistakes_.motor_clock(clock_us()) : clock_us(),
                  &wrench);
  if (mistakes_.wrench) mistakes_.wrench(wrench);
  const Wrench F = {vector(wrench.force_uN), vector(wrench.torque_uNm)};
  max_force_N_ = std::max(max_force_N_, F.force_N.norm());
  max_torque_Nm_ = std::max(max_torque_Nm_, F.torque_Nm.norm());
  handle_.step(path_.at(now_ - power_on_), F);
  ++substeps_;
  if (substeps_ % kSubstepsPerSample == 0) read_encoders();
  if (substeps_ % kSubstepsPerReport != 0) return;
  ReportBytes report(WF_POSE_REPORT_BYTES);
  wf_make_report(&firmware_, &sample_, report.data());
  if (mistakes_.report) mistakes_.report(report);
  if (!report.empty()) host.take_report(now_, report);
}

void FirmwareInHand::read_encoders() noexcept {
  const Pose& X_BH = handle_.X_BH();
  const Vector3d p_m = quantised(X_BH.translation_m, position_quantum_m_);
  const Quaterniond q = rotation_from(quantised(rotation_vector(X_BH.rotation), rotation_quantum_rad_));
  for (int i = 0; i < 3; ++i) sample_.position[i] = counts(p_m[i], 1e-7);
  for (int i = 0; i < 4; ++i) sample_.orientation[i] = counts(q.coeffs()[i], 0x1p-30);
  sample_.device_time_us = clock_us();
  wf_velocity_update(&velocity_, &sample_);
}

bool FirmwareInHand::take_command(TimePoint, std::span<const std::uint8_t> bytes) noexcept {
  CommandBytes command(bytes.begin(), bytes.end());
  ++commands_;
  if (mistakes_.command) mistakes_.command(command, firmware_);
  return wf_take_command(&firmware_, clock_us(), command.data(), command.size());
}

TimePoint FirmwareInHand::next_event() const noexcept {
  const std::uint64_t left = kSubstepsPerReport - substeps_ % kSubstepsPerReport;
  return now_ + substep_ * static_cast<std::int64_t>(left);
}

}  // namespace wrenchd::test
