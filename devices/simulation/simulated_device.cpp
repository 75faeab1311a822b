// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/simulated_device.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"
#include "devices/layout_validation.hpp"

namespace wrenchd {
namespace {

/// Encoder samples per report: enough for the velocity filter to smooth over quanta.
constexpr std::uint64_t kSamplesPerReport = 8;
/// Longest substep [s]: a tenth of the fastest time constant of a stiff hand on a light handle.
constexpr double kMaxSubstep_s = 1.0 / 16000.0;

constexpr double kJump_m = 0.1;
constexpr double kDriftSpeed_m_per_s = 3.0;
constexpr double kVibration_m = 1e-3;
constexpr double kVibration_Hz = 80.0;
constexpr double kBadQuaternionLength = 0.5;

double report_period(const DeviceProfile& profile) {
  if (!is_finite(profile.report_rate_Hz) || profile.report_rate_Hz <= 0.0)
    throw std::invalid_argument("device profile " + profile.name + ": report_rate_Hz must be above 0");
  return 1.0 / profile.report_rate_Hz;
}

std::uint64_t substeps_per_sample(const DeviceProfile& profile) {
  const double sample_period_s = report_period(profile) / static_cast<double>(kSamplesPerReport);
  return static_cast<std::uint64_t>(std::ceil(sample_period_s / kMaxSubstep_s - 1e-9));
}

/// Rounded to whole nanoseconds, so a report period may differ by half a nanosecond per substep.
Duration substep_of(const DeviceProfile& profile) {
  const double substeps = static_cast<double>(kSamplesPerReport * substeps_per_sample(profile));
  return Duration{std::max(std::llround(1e9 * report_period(profile) / substeps), 1LL)};
}

/// Checks that the device has six degrees of freedom, sends whole poses and accepts wrenches.
const PoseReportLayout& checked_layout(const DeviceProfile& profile) {
  if (pose_source(profile) != PoseSource::pose || sensed_dofs(profile) != kAllDofs ||
      driven_dofs(profile) != kAllDofs)
    throw std::invalid_argument(
        "device profile " + profile.name +
        ": the simulated device sends whole poses and accepts wrenches, this one does not; "
        "choose a profile that inherits loopback");
  validate(profile.pose_report);
  validate(profile.wrench_report);
  return profile.pose_report;
}

}  // namespace

SimulatedDevice::SimulatedDevice(const DeviceProfile& profile, const SimulationSettings& settings)
    : pose_layout_(checked_layout(profile)),
      wrench_point_(profile.wrench_point),
      grasp_button_(button_bit(profile.grasp_button)),
      X_BD_(profile.X_BD),
      X_HE_(inverse(profile.X_EH)),
      same_frames_(same_bits(profile.X_BD, {}) && same_bits(profile.X_EH, {})),
      substeps_per_sample_(substeps_per_sample(profile)),
      substeps_per_report_(kSamplesPerReport * substeps_per_sample_),
      substep_(substep_of(profile)),
      hand_(settings),
      handle_(settings, hand_.target().X_BG, seconds(substep_)),
      firmware_(profile, settings, substep_ * static_cast<std::int64_t>(substeps_per_sample_)) {
  firmware_.initialize_encoders(handle_.X_BH());
}

bool SimulatedDevice::displace_path(const Vector3d& d_B_m) {
  hand_.displace(d_B_m);
  handle_.reset_to(hand_.target().X_BG);
  firmware_.initialize_encoders(handle_.X_BH());
  return true;
}

void SimulatedDevice::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = true;
    power_on_ = now_ = t;
    faults_.power_on(t);
  }
  if (t - now_ > kMaxCatchUp) skip_to(t);
  while (now_ + substep_ <= t) substep(host);
}

void SimulatedDevice::skip_to(TimePoint t) noexcept {
  const Duration period = substep_ * static_cast<std::int64_t>(substeps_per_report_);
  const std::int64_t periods = (t - now_) / period;
  now_ += periods * period;
  firmware_.skip_reports(static_cast<std::uint32_t>(periods));
  firmware_.trip_watchdog();
  handle_.stop();
  firmware_.initialize_encoders(handle_.X_BH());
}

void SimulatedDevice::substep(ReportSink& host) noexcept {
  now_ += substep_;
  apply_firmware_faults();
  const HandTarget target = hand_.advance(now_, now_ - power_on_, seconds(substep_));
  if (hand_.prescribed())
    handle_.step_prescribed(target, motor_demand());
  else
    handle_.step(target, motor_demand());
  ++substeps_;
  if (substeps_ % substeps_per_sample_ == 0) firmware_.sample(handle_.X_BH());
  if (substeps_ % substeps_per_report_ == 0) send_report(host);
}

/// Returns the wrench of the motors about the handle point, in B.
Wrench SimulatedDevice::motor_demand() noexcept {
  Wrench F = firmware_.motor_wrench(now_);
  const Pose& X_BH = handle_.X_BH();
  if (!same_frames_) F = shifted(expressed(X_BD_.rotation, F), -(X_BH.rotation * X_HE_.translation_m));
  return wrench_point_ == WrenchPoint::handle ? F : shifted(F, X_BH.translation_m);
}

/// Converts from the handle in the base to the device's end frame in its own base frame.
void SimulatedDevice::express_in_device_frames(PoseReport& report) const noexcept {
  const Twist V_BE = shifted(report.V_BH, report.X_BH.rotation * X_HE_.translation_m);
  report.V_BH = expressed(X_BD_.rotation.conjugate(), V_BE);
  report.X_BH = inverse(X_BD_) * report.X_BH * X_HE_;
}

void SimulatedDevice::send_report(ReportSink& host) noexcept {
  using Kind = SimulatedFault::Kind;
  PoseReport report = firmware_.make_report(now_ - power_on_);
  if (!same_frames_) express_in_device_frames(report);
  if (hand_.grasps(now_ - power_on_)) report.buttons |= grasp_button_;
  apply_report_faults(report);
  if (fault_active_during(Kind::bad_quaternion, now_, now_))
    report.X_BH.rotation.coeffs() *= kBadQuaternionLength;
  std::array<std::uint8_t, kMaxReportBytes> bytes;
  host.take_report(now_, std::span(bytes).first(encode(pose_layout_, report, bytes)));
}

bool SimulatedDevice::take_command(TimePoint, std::span<const std::uint8_t> bytes) noexcept {
  return firmware_.take_command(now_, bytes);
}

/// Applies the active faults to a report.
void SimulatedDevice::apply_report_faults(PoseReport& report) noexcept {
  using Kind = SimulatedFault::Kind;
  const auto value = [](const SimulatedFault& fault, double fallback) {
    return fault.value > 0.0 ? fault.value : fallback;
  };
  Vector3d& p_m = report.X_BH.translation_m;
  if (const SimulatedFault* f = faults_.active_at(Kind::jump, now_)) p_m.x() += value(*f, kJump_m);
  if (const SimulatedFault* f = faults_.active_at(Kind::drift, now_)) {
    const double distance_m = value(*f, kDriftSpeed_m_per_s) * seconds(now_ - faults_.start_of(*f));
    p_m.x() += kJump_m - std::abs(std::fmod(distance_m, 2.0 * kJump_m) - kJump_m);
  }
  if (const SimulatedFault* f = faults_.active_at(Kind::vibrate, now_)) {
    const double amplitude_m = value(*f, kVibration_m), w_per_s = 2.0 * std::numbers::pi * kVibration_Hz;
    const double phase = w_per_s * seconds(now_ - faults_.start_of(*f));
    p_m.z() += amplitude_m * std::sin(phase);
    report.V_BH.linear_m_per_s.z() += amplitude_m * w_per_s * std::cos(phase);
  }
  if (const SimulatedFault* f = faults_.active_at(Kind::press_button, now_))
    report.buttons |= std::uint32_t{1} << (static_cast<unsigned>(f->value) & 31U);
  if (!fault_active_during(Kind::freeze_pose, now_, now_)) last_unstuck_pose_ = report.X_BH;
  report.X_BH = last_unstuck_pose_;
}

/// Applies the active faults to the firmware, before commands and motors are processed.
void SimulatedDevice::apply_firmware_faults() noexcept {
  using Kind = SimulatedFault::Kind;
  firmware_.set_watchdog_enabled(!fault_active_during(Kind::disable_watchdog, now_, now_));
  if (fault_active_during(Kind::trip_watchdog, now_, now_)) firmware_.trip_watchdog();
  if (fault_active_during(Kind::motors_off, now_, now_)) firmware_.switch_motors_off();
}

TimePoint SimulatedDevice::next_event() const noexcept {
  const std::uint64_t remaining = substeps_per_report_ - substeps_ % substeps_per_report_;
  return now_ + substep_ * static_cast<std::int64_t>(remaining);
}

}  // namespace wrenchd
