// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/profile_device.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/finite.hpp"
#include "devices/layout_validation.hpp"

namespace wrenchd {
namespace {

/// Permitted squared norm of a reported quaternion. Integer rounding changes it by at most 1e-4 (16 bits). A
/// larger deviation is a wrong field, a wrong unit or noise.
constexpr double kMinQuaternionNorm2 = 0.8;
constexpr double kMaxQuaternionNorm2 = 1.2;

/// Permitted motion between two poses, as a multiple of the motion at the speed limit. Leaves room for jitter
/// of the device clock; encoder errors are far larger.
constexpr double kJumpFactor = 3.0;
/// Motion that is always permitted: one step of the coarsest useful encoder (100 um), and the same at a grip
/// radius of 50 mm.
constexpr double kEncoderStep_m = 1e-4;
constexpr double kEncoderStep_rad = 2e-3;
/// Consecutive samples above the speed limit that raise a fault; a single one may be a glitch.
constexpr int kMaxOverspeedSamples = 2;

/// Returns the largest value of a counter.
std::uint64_t max_count(const ReportField& field) noexcept {
  return field.bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << field.bits) - 1;
}

/// Returns the increment of a counter modulo its width; 0 if the device has none.
std::uint64_t increment(const ReportField& field, std::uint64_t from, std::uint64_t to) noexcept {
  return field.present ? (to - from) & max_count(field) : 0;
}

/// Returns the largest increment that counts as forward.
std::uint64_t max_increment(const ReportField& field) noexcept {
  return field.present ? max_count(field) >> 1 : 1;
}

/// Scales a vector to a maximum length, with a margin for the rounding of three components to counts of
/// `step`.
Vector3d clamp_norm(const Vector3d& v, double max_norm, double step) noexcept {
  constexpr double half_diagonal = 0.87;  // > sqrt(3)/2
  const double limit = std::max(max_norm - half_diagonal * std::abs(step), 0.0);
  const double length = v.norm();
  return length <= limit ? v : Vector3d(v * (limit / length));
}

[[noreturn]] void reject_profile(const DeviceProfile& profile, const std::string& why) {
  throw std::runtime_error("device profile " + profile.name + ": " + why);
}

void check_number(const DeviceProfile& profile, const char* key, double value) {
  if (!is_finite(value) || value <= 0.0)
    reject_profile(profile, std::string(key) + " must be stated and above 0");
}

void check_profile(const DeviceProfile& profile) {
  if (profile.has_output) {
    check_number(profile, "max_force_N", profile.max_force_N);
    if (profile.wrench_report.torque.present || !(profile.max_torque_Nm == 0.0))
      check_number(profile, "max_torque_Nm", profile.max_torque_Nm);
  }
  check_number(profile, "max_linear_speed_m_per_s", profile.max_linear_speed_m_per_s);
  check_number(profile, "max_angular_speed_rad_per_s", profile.max_angular_speed_rad_per_s);
  check_number(profile, "stale_fault_s", profile.stale_fault_s);
  try {
    validate_reports(profile);
  } catch (const std::invalid_argument& e) {
    reject_profile(profile, e.what());
  }
}

bool has_pose_fields(const PoseReportLayout& layout) noexcept {
  return layout.position.present || layout.orientation.present || layout.joints.present;
}

}  // namespace

ProfileDevice::ProfileDevice(DeviceProfile profile, ReportLink& link)
    : profile_(std::move(profile)), link_(link), pose_observer_(dynamic_cast<PoseObserver*>(&link)) {}

void ProfileDevice::open() {
  check_profile(profile_);
  link_.open();
  recalibrate(profile_);
  device_time_field_ = acknowledged_field_ = nullptr;
  pose_layouts_ = 0;
  for (std::size_t i = 0; i <= profile_.more_reports.size(); ++i) {
    const PoseReportLayout& report = *layout(i);
    if (report.device_time.present) device_time_field_ = &report.device_time;
    if (report.acknowledged.present) acknowledged_field_ = &report.acknowledged;
    if (has_pose_fields(report)) pose_layouts_ |= std::uint64_t{1} << i;
  }
  sample_ = {};
  state_ = {};
  deflection_.reset();
  if (profile_.deflection)
    deflection_.emplace(*profile_.deflection, profile_.max_linear_speed_m_per_s,
                        profile_.max_angular_speed_rad_per_s);
  silent_since_.reset();
  velocity_ = VelocityEstimator(velocity_estimator_settings(profile_));
  estimated_velocity_dofs_ = estimated_velocity_dofs(profile_);
  acknowledged_.reset();
  sent_before_open_ = commands_sent_;
  report_received_ = disconnected_ = kinematics_valid_ = false;
  trusted_reports_ = 0;
  layouts_since_open_ = 0;
  overspeed_samples_ = 0;
  open_ = true;
}

void ProfileDevice::recalibrate(const DeviceProfile& calibrated) noexcept {
  profile_.X_BD = calibrated.X_BD;
  profile_.X_EH = calibrated.X_EH;
  profile_.kinematics.zero_rad = calibrated.kinematics.zero_rad;
  same_frames_ = same_bits(profile_.X_BD, {}) && same_bits(profile_.X_EH, {});
  forget_motion();
  kinematics_valid_ = false;
}

void ProfileDevice::close() noexcept {
  open_ = false;
  link_.close();
}

const PoseReportLayout* ProfileDevice::layout(std::size_t index) const noexcept {
  return index == 0 ? &profile_.pose_report : &profile_.more_reports[index - 1];
}

// --- reading ----------------------------------------------------------------------------------------------

DeviceSample ProfileDevice::read_newest(TimePoint now) noexcept {
  sample_.fresh = false;
  sample_.fault = Fault::none;
  sample_.superseded = sample_.missing = sample_.rejected = sample_.repeated = 0;
  if (!silent_since_) {
    discard_waiting_reports(now);
  } else if (const std::optional<Arrival> newest = drain(now); newest && !disconnected_) {
    update_sample(*newest);
  }
  if (deflection_ && open_ && !disconnected_) integrate_deflection(now);
  if (disconnected_ || !open_) {
    sample_.fault = Fault::device_lost;
  } else if (sample_.fault == Fault::none && silent_too_long(now)) {
    sample_.fault = Fault::sample_stale;
  }
  prompt_device(now);
  return sample_;
}

/// The first read discards all reports that waited since open(), not only as many as later reads process: if
/// the buffer of the link has overflowed since open(), the dropped reports would count as missing. The limit
/// bounds the time of this read if a device sends faster than the host reads. The time of silence starts
/// here.
void ProfileDevice::discard_waiting_reports(TimePoint now) noexcept {
  constexpr int kMaxDiscardedReports = 16 * kMaxReportsPerRead;
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  for (int i = 0; i < kMaxDiscardedReports && !disconnected_ && open_; ++i) {
    const LinkStatus status = link_.read(now, buffer).status;
    disconnected_ = status == LinkStatus::disconnected;
    if (status != LinkStatus::ok) break;
  }
  sample_ = {};
  sample_.sensed_dofs = sensed_dofs(profile_);
  sample_.driven_dofs = driven_dofs(profile_);
  sample_.estimated_velocity_dofs = estimated_velocity_dofs_;
  report_received_ = false;
  layouts_since_open_ = 0;
  trusted_reports_ = 0;
  state_ = {};
  if (deflection_) deflection_->set_deflection(Vector3d::Zero(), Vector3d::Zero());
  silent_since_ = deflection_time_ = now;
  prompted_at_ = now - kLockStepTimeout;  // prompts a lock-step device at once
}

/// Sends a command to a lock-step device that is silent since open() or since a lost report, and keep-alive
/// reports to a device that needs them.
void ProfileDevice::prompt_device(TimePoint now) noexcept {
  const bool lock_step = profile_.stream == StreamStyle::lock_step;
  if (!open_ || disconnected_ || (!lock_step && profile_.keep_alive.bytes.empty())) return;
  if (now - prompted_at_ < (lock_step ? kLockStepTimeout : from_seconds(profile_.keep_alive_period_s)))
    return;
  if (!lock_step && !trusted()) return;
  prompted_at_ = now;
  if (!lock_step)
    transmit(now, profile_.keep_alive.bytes);
  else if (!report_received_ || now - *silent_since_ >= kLockStepTimeout)
    send(now, {}, false);
}

/// A device that is silent at rest may be silent after a report of zero deflection.
bool ProfileDevice::silent_too_long(TimePoint now) const noexcept {
  if (profile_.stream == StreamStyle::silent_at_rest && (!deflection_ || deflection_->at_rest()))
    return false;
  return silent_since_ && now - *silent_since_ > from_seconds(profile_.stale_fault_s);
}

std::optional<ProfileDevice::Arrival> ProfileDevice::drain(TimePoint now) noexcept {
  std::optional<Arrival> newest;
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  layouts_this_read_ = 0;
  for (int i = 0; i < kMaxReportsPerRead && !disconnected_ && open_; ++i) {
    const LinkRead read = link_.read(now, buffer);
    disconnected_ = read.status == LinkStatus::disconnected;
    if (read.status != LinkStatus::ok) break;
    const auto bytes = std::span<const std::uint8_t>(buffer).first(std::min(read.length, buffer.size()));
    const PoseReportLayout* matching = nullptr;
    if (read.length <= buffer.size()) matching = decode_report(bytes, read.arrived);
    if (matching == nullptr) {
      if (is_other_report(bytes)) continue;
      ++sample_.rejected;
      judge(false);
      continue;
    }
    judge(true);
    newest = Arrival{matching, read.arrived};
  }
  return newest;
}

/// A device may number its reports and declare some that the profile does not need, such as keys.
bool ProfileDevice::is_other_report(std::span<const std::uint8_t> bytes) const noexcept {
  for (std::size_t i = 0; i <= profile_.more_reports.size(); ++i) {
    const PoseReportLayout& known = *layout(i);
    if (!known.has_id || bytes.empty() || known.id == bytes[0]) return false;
  }
  return link_.declares(bytes);
}

/// One valid report is enough for a device without motors: it gets its shutdown report only.
void ProfileDevice::judge(bool valid) noexcept {
  if (trusted()) return;
  const int next = profile_.has_output ? trusted_reports_ + 1 : kTrustReports;
  trusted_reports_ = valid ? next : 0;
}

/// Finds the layout of a report and decodes it into state_. A second report of the same layout in one read
/// supersedes the first.
const PoseReportLayout* ProfileDevice::decode_report(std::span<const std::uint8_t> bytes,
                                                     TimePoint arrived) noexcept {
  for (std::size_t i = 0; i <= profile_.more_reports.size(); ++i) {
    const PoseReportLayout& matching = *layout(i);
    PoseReport report = state_;
    if (decode_into(matching, bytes, report) != Decoding::ok) continue;
    if (!accept_counters(matching, report, arrived)) {
      ++sample_.repeated;
      return nullptr;
    }
    if (deflection_) {
      integrate_deflection(arrived);
      apply_deflection(report);
    }
    state_ = report;
    const std::uint64_t bit = std::uint64_t{1} << i;
    if ((layouts_this_read_ & bit) != 0) ++sample_.superseded;
    layouts_this_read_ |= bit;
    layouts_since_open_ |= bit;
    return &matching;
  }
  return nullptr;
}

/// Updates the counters. Returns false for a repeated or decreasing counter, which has moved more than half
/// its range. After a silence that is itself a fault, counters may have any value, so the report counts as a
/// restart.
bool ProfileDevice::accept_counters(const PoseReportLayout& layout, const PoseReport& report,
                                    TimePoint arrived) noexcept {
  const bool after_silence = silent_too_long(arrived);
  if (report_received_) {
    const std::uint64_t reports =
        layout.sequence.present ? increment(layout.sequence, sequence_, report.sequence) : 1;
    const std::uint64_t ticks = increment(layout.device_time, device_time_, report.device_time);
    const bool decreasing =
        reports > max_increment(layout.sequence) || ticks > max_increment(layout.device_time);
    if (reports == 0 || (decreasing && !after_silence)) return false;
    sample_.sequence += reports;
    sample_.missing += static_cast<std::uint32_t>(reports - 1);
    device_ticks_ += ticks;
  } else {
    sample_.sequence = report.sequence;
    device_ticks_ = report.device_time;
    report_received_ = true;
  }
  if (after_silence) {
    sample_.fault = Fault::sample_stale;
    forget_motion();
  }
  sequence_ = report.sequence;
  device_time_ = report.device_time;
  silent_since_ = arrived;
  return true;
}

void ProfileDevice::update_sample(const Arrival& newest) noexcept {
  update_device_time(newest);
  update_acknowledged();
  strip_count_button(profile_.kinematics, state_.joints, state_.buttons);
  sample_.buttons = state_.buttons;
  if (newest.layout->motors_on.present) sample_.motors_on = state_.motors_on;
  sample_.watchdog_tripped = state_.watchdog_tripped;
  if (!state_.homed) forget_motion();  // the zero of the encoders is about to change
  sample_.homed = state_.homed;
  if (deflection_ || !state_.homed || (layouts_since_open_ & pose_layouts_) != pose_layouts_ ||
      (layouts_this_read_ & pose_layouts_) == 0) {
    kinematics_valid_ = kinematics_valid_ && state_.homed;
    return;
  }
  sample_.fresh = true;
  PoseReport report = state_;
  Fault fault = compute_pose(report);
  if (fault == Fault::none) fault = validate_pose(report);
  if (fault != Fault::none) {
    velocity_.reset();
    judge(false);
    sample_.fault = fault;
    return;
  }
  sample_.X_BH = *previous_pose_;
  estimate_velocity(report.V_BH);
  sample_.V_BH = report.V_BH;
}

void ProfileDevice::forget_motion() noexcept {
  previous_pose_.reset();
  velocity_.reset();
}

/// The lever from E to H has moved a reported linear velocity by a reported angular velocity only.
void ProfileDevice::estimate_velocity(Twist& V_BH) noexcept {
  if (estimated_velocity_dofs_ == kNoDof) return;
  const Twist estimate = velocity_.update(sample_.device_time_s, sample_.X_BH);
  if ((estimated_velocity_dofs_ & kAngularDofs) != 0) {
    V_BH.angular_rad_per_s = estimate.angular_rad_per_s;
    if (!same_frames_) {
      const Vector3d lever_B_m =
          sample_.X_BH.rotation * (inverse(profile_.X_EH).rotation * profile_.X_EH.translation_m);
      V_BH.linear_m_per_s += V_BH.angular_rad_per_s.cross(lever_B_m);
    }
  }
  if ((estimated_velocity_dofs_ & kLinearDofs) != 0) V_BH.linear_m_per_s = estimate.linear_m_per_s;
}

Fault ProfileDevice::compute_pose(PoseReport& report) noexcept {
  const Kinematics& k = profile_.kinematics;
  if (k.kind != Kinematics::Kind::none) {
    joint_angles_ = wrenchd::joint_angles(k, strip_count_button(k, report.joints, report.buttons));
    const std::optional<Pose> X_DE = forward_kinematics(k, joint_angles_, X_DE_);
    kinematics_valid_ = X_DE.has_value();
    if (!X_DE) return Fault::pose_not_finite;
    report.X_BH = X_DE_ = *X_DE;
    J_ = jacobian(k, joint_angles_, X_DE_);
  }
  if (same_frames_) return Fault::none;
  const Quaterniond& R_BD = profile_.X_BD.rotation;
  X_DE_ = report.X_BH;
  const double norm = X_DE_.rotation.norm();
  if (!is_finite(X_DE_) || norm == 0.0) return Fault::pose_not_a_rotation;
  X_DE_.rotation.coeffs() /= norm;
  report.X_BH = profile_.X_BD * X_DE_ * profile_.X_EH;
  report.X_BH.rotation.coeffs() *= norm;  // validate_pose() checks the norm as reported
  report.V_BH = expressed(R_BD, shifted(report.V_BH, X_DE_.rotation * profile_.X_EH.translation_m));
  return Fault::none;
}

/// Sets the deflection and handles the buttons of the puck.
void ProfileDevice::apply_deflection(const PoseReport& report) noexcept {
  const Quaterniond& R_BD = profile_.X_BD.rotation;
  deflection_->set_deflection(R_BD * report.translation_m, R_BD * report.rotation_rad);
  const std::uint32_t recentre = button_bit(profile_.recentre_button);
  if ((report.buttons & ~state_.buttons & recentre) != 0) deflection_->recentre();
  deflection_->set_slow((report.buttons & button_bit(profile_.slow_button)) != 0);
}

/// Integrates the steered pose up to `now`, also between reports.
void ProfileDevice::integrate_deflection(TimePoint now) noexcept {
  if (now <= deflection_time_) return;
  const bool no_pose = silent_too_long(now);
  if (no_pose) deflection_->set_deflection(Vector3d::Zero(), Vector3d::Zero());
  const double dt_s = seconds(now - deflection_time_);
  deflection_->advance(dt_s);
  deflection_time_ = now;
  sample_.device_time_s += dt_s;
  sample_.arrived = now;
  sample_.fresh = true;
  sample_.X_BH = deflection_->X_BH();
  sample_.V_BH = deflection_->V_BH();
  if (pose_observer_ != nullptr) pose_observer_->observe_pose(now, sample_.X_BH);
  if (no_pose) sample_.fault = Fault::sample_stale;
}

/// Updates arrival and device time of the sample. For a device without a clock the host time is used.
void ProfileDevice::update_device_time(const Arrival& newest) noexcept {
  if (deflection_) return;
  if (device_time_field_ != nullptr) {
    sample_.device_time_s = device_time_field_->step * static_cast<double>(device_ticks_);
  } else if (sample_.arrived != TimePoint{}) {
    sample_.device_time_s += seconds(newest.arrived - sample_.arrived);
  }
  sample_.arrived = newest.arrived;
}

/// Returns the maximum time since the previous valid pose [s], so that a coarse clock does not make motion
/// appear fast. At most the time after which silence is a fault.
double ProfileDevice::elapsed_s() const noexcept {
  const double one_tick_s = device_time_field_ != nullptr ? device_time_field_->step : 0.0;
  return std::min(sample_.device_time_s - previous_pose_time_s_ + one_tick_s, profile_.stale_fault_s);
}

/// Unwraps the acknowledged sequence if the command was sent since open(). Before the device accepts such a
/// command, the value refers to an earlier session.
void ProfileDevice::update_acknowledged() noexcept {
  const std::uint64_t raw = state_.acknowledged;
  if (acknowledged_field_ == nullptr || raw == acknowledged_) return;
  acknowledged_ = raw;
  const std::uint64_t behind = (commands_sent_ - raw) & max_count(*acknowledged_field_);
  if (behind < commands_sent_ - sent_before_open_) sample_.acknowledged = commands_sent_ - behind;
}

Fault ProfileDevice::validate_pose(PoseReport report) noexcept {
  if (!is_finite(report.X_BH) || !is_finite(report.V_BH)) return Fault::pose_not_finite;
  const double norm2 = report.X_BH.rotation.squaredNorm();
  if (norm2 < kMinQuaternionNorm2 || norm2 > kMaxQuaternionNorm2) return Fault::pose_not_a_rotation;
  report.X_BH.rotation.normalize();
  const Fault fault = validate_motion(report);
  previous_pose_ = report.X_BH;
  previous_pose_time_s_ = sample_.device_time_s;
  return fault;
}

Fault ProfileDevice::validate_motion(const PoseReport& report) noexcept {
  const double max_v = profile_.max_linear_speed_m_per_s;
  const double max_w = profile_.max_angular_speed_rad_per_s;
  double v = report.V_BH.linear_m_per_s.norm();
  double w = report.V_BH.angular_rad_per_s.norm();
  if (previous_pose_) {
    const double distance_m =
        (report.X_BH.translation_m - previous_pose_->translation_m).norm() - kEncoderStep_m;
    const double angle_rad =
        report.X_BH.rotation.angularDistance(previous_pose_->rotation) - kEncoderStep_rad;
    const double t = elapsed_s();
    if (distance_m > kJumpFactor * max_v * t || angle_rad > kJumpFactor * max_w * t)
      return Fault::pose_jumped;
    if (t > 0.0) {
      v = std::max(v, distance_m / t);
      w = std::max(w, angle_rad / t);
    }
  }
  overspeed_samples_ = v > max_v || w > max_w ? overspeed_samples_ + 1 : 0;
  return overspeed_samples_ >= kMaxOverspeedSamples ? Fault::overspeed : Fault::none;
}

// --- writing ----------------------------------------------------------------------------------------------

Fault ProfileDevice::write(TimePoint now, const Wrench& F, bool motors_on) noexcept {
  if (!is_finite(F)) {
    sample_.dropped_dofs = kNoDof;
    send(now, {}, false);
    return Fault::wrench_not_finite;
  }
  sample_.dropped_dofs = motors_on ? static_cast<DofMask>(nonzero_dofs(F) & ~driven_dofs(profile_)) : kNoDof;
  if (!profile_.has_output) return open_ && !disconnected_ ? Fault::none : Fault::device_lost;
  const bool no_pose = profile_.kinematics.kind != Kinematics::Kind::none && !kinematics_valid_;
  if (!motors_on || no_pose || !sample_.homed) return send(now, {}, false);
  const double authority = profile_.watchdog_s > 0.0 ? 1.0 : kAuthorityWithoutWatchdog;
  const WrenchReportLayout& report = profile_.wrench_report;
  Wrench sent;
  sent.force_N =
      clamp_norm(F.force_N, authority * profile_.max_force_N, report.force.present ? report.force.step : 0);
  if (report.torque.present)
    sent.torque_Nm = clamp_norm(F.torque_Nm, authority * profile_.max_torque_Nm, report.torque.step);
  return send(now, sent, true);
}

void ProfileDevice::fill_wrench(const Wrench& F_B, WrenchReport& report) const noexcept {
  report.F = F_B;
  if (!same_frames_)
    report.F = shifted(expressed(profile_.X_BD.rotation.conjugate(), F_B),
                       -(X_DE_.rotation * profile_.X_EH.translation_m));
  if (profile_.wrench_report.efforts.present)
    report.efforts = motor_efforts(profile_.kinematics, J_, report.F.force_N);
}

Fault ProfileDevice::send(TimePoint now, const Wrench& F, bool motors_on) noexcept {
  if (!open_) return Fault::device_lost;
  if (!profile_.has_output) return Fault::none;
  if (!trusted()) {
    if (profile_.stream != StreamStyle::lock_step) return Fault::none;
    motors_on = false;
  }
  WrenchReport report;
  if (motors_on) fill_wrench(F, report);
  report.hold_time_s =
      std::max(profile_.watchdog_s,
               profile_.wrench_report.hold_time.step);  // 0 would select the default of the device
  report.sequence = ++commands_sent_;
  report.enable = motors_on;
  if (!profile_.pose_report.motors_on.present) sample_.motors_on = motors_on;
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  const std::size_t length = encode(profile_.wrench_report, report, buffer);
  return transmit(now, std::span(buffer).first(length));
}

Fault ProfileDevice::transmit(TimePoint now, std::span<const std::uint8_t> bytes) noexcept {
  switch (link_.write(now, bytes)) {
    case LinkStatus::ok:
      return Fault::none;
    case LinkStatus::not_ready:
      return Fault::write_failed;
    case LinkStatus::disconnected:
      break;
  }
  return Fault::device_lost;
}

void ProfileDevice::release(TimePoint now) noexcept {
  for (int i = 0; i < kReleaseReports; ++i) send(now, {}, false);
  if (open_ && trusted() && !profile_.shutdown.bytes.empty()) transmit(now, profile_.shutdown.bytes);
}

}  // namespace wrenchd
