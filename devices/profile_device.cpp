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

namespace wrenchd {
namespace {

/// Squared length of a reported quaternion that still passes for a rotation. Integers round to parts in 1e4
/// at worst (16 bits); what is outside is another field, another unit or noise.
constexpr double kLeastQuaternionNorm2 = 0.8;
constexpr double kMostQuaternionNorm2 = 1.2;

/// A pose may move this many times as far as the fastest allowed handle would: room for jitter of the device
/// clock, far from what a wrong encoder does.
constexpr double kTeleportFactor = 3.0;
/// Motion that is never held against a device: a step of the coarsest encoder that is of use (100 um), and as
/// much at a 50 mm grip.
constexpr double kEncoderStep_m = 1e-4;
constexpr double kEncoderStep_rad = 2e-3;
/// Samples over speed before it counts: one may be a glitch.
constexpr int kFastSamples = 2;

/// How far a counter has moved on, modulo its width; 0 where the device has none.
std::uint64_t ahead(const ReportField& field, std::uint32_t from, std::uint32_t to) noexcept {
  if (!field.present) return 0;
  const std::uint64_t span = std::uint64_t{1} << field.bits;
  return (span + to - from) % span;
}

/// The farthest move that is one forward and not one back.
std::uint64_t half_way(const ReportField& field) noexcept {
  return field.present ? (std::uint64_t{1} << (field.bits - 1)) - 1 : 1;
}

/// Cut to a length, direction kept, with room for the rounding of three components to counts of `step`.
Vector3d within(const Vector3d& v, double most, double step) noexcept {
  constexpr double half_diagonal = 0.87;  // > sqrt(3)/2
  const double ceiling = std::max(most - half_diagonal * std::abs(step), 0.0);
  const double length = v.norm();
  return length <= ceiling ? v : Vector3d(v * (ceiling / length));
}

[[noreturn]] void refuse(const DeviceProfile& profile, const std::string& why) {
  throw std::runtime_error("device profile " + profile.name + ": " + why);
}

void check_number(const DeviceProfile& profile, const char* key, double value) {
  if (!is_finite(value) || value <= 0.0) refuse(profile, std::string(key) + " must be stated and above 0");
}

void check_profile(const DeviceProfile& profile) {
  check_number(profile, "max_force_N", profile.max_force_N);
  check_number(profile, "max_torque_Nm", profile.max_torque_Nm);
  check_number(profile, "max_linear_speed_m_per_s", profile.max_linear_speed_m_per_s);
  check_number(profile, "max_angular_speed_rad_per_s", profile.max_angular_speed_rad_per_s);
  check_number(profile, "stale_fault_s", profile.stale_fault_s);
  try {
    check(profile.pose_report);
    check(profile.wrench_report);
  } catch (const std::invalid_argument& e) {
    refuse(profile, e.what());
  }
}

}  // namespace

ProfileDevice::ProfileDevice(DeviceProfile profile, ReportLink& link)
    : profile_(std::move(profile)), link_(link) {}

void ProfileDevice::open() {
  check_profile(profile_);
  link_.open();
  sample_ = {};
  silent_since_.reset();
  reported_.reset();
  acknowledged_.reset();
  sent_before_open_ = commands_sent_;
  heard_ = gone_ = false;
  fast_samples_ = 0;
  open_ = true;
}

void ProfileDevice::close() noexcept {
  open_ = false;
  link_.close();
}

// --- reading ----------------------------------------------------------------------------------------------

DeviceSample ProfileDevice::read_newest(TimePoint now) noexcept {
  sample_.fresh = false;
  sample_.fault = Fault::none;
  sample_.skipped = sample_.missing = sample_.rejected = 0;
  if (!silent_since_) {
    start(now);
  } else if (const std::optional<Arrival> newest = drain(now); newest && !gone_) {
    take(*newest);
  }
  if (gone_ || !open_) {
    sample_.fault = Fault::device_lost;
  } else if (sample_.fault == Fault::none && silent_too_long(now)) {
    sample_.fault = Fault::sample_stale;
  }
  return sample_;
}

/// The first read throws away what waited since open(), however old, and the time of silence begins.
void ProfileDevice::start(TimePoint now) noexcept {
  drain(now);
  sample_ = {};
  heard_ = false;
  silent_since_ = now;
}

bool ProfileDevice::silent_too_long(TimePoint now) const noexcept {
  return silent_since_ && now - *silent_since_ > from_seconds(profile_.stale_fault_s);
}

std::optional<ProfileDevice::Arrival> ProfileDevice::drain(TimePoint now) noexcept {
  std::optional<Arrival> newest;
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  for (int i = 0; i < kMostReportsPerRead && !gone_ && open_; ++i) {
    const LinkRead read = link_.read(now, buffer);
    gone_ = read.status == LinkStatus::gone;
    if (read.status != LinkStatus::ok) break;
    const auto bytes = std::span<const std::uint8_t>(buffer).first(std::min(read.length, buffer.size()));
    const auto [outcome, report] = decode(profile_.pose_report, bytes);
    if (read.length > buffer.size() || outcome != Decoding::ok || !count_in(report, read.arrived)) {
      ++sample_.rejected;
      continue;
    }
    if (newest) ++sample_.skipped;
    newest = Arrival{report, read.arrived};
  }
  return newest;
}

/// Follows the counters. False for a repetition, or a step back: more than half way round. After a silence
/// that is a fault by itself the counters may be anywhere, so then a step back is a new start.
bool ProfileDevice::count_in(const PoseReport& report, TimePoint arrived) noexcept {
  const PoseReportLayout& layout = profile_.pose_report;
  const bool after_silence = silent_too_long(arrived);
  if (heard_) {
    const std::uint64_t reports =
        layout.sequence.present ? ahead(layout.sequence, sequence_, report.sequence) : 1;
    const std::uint64_t ticks = ahead(layout.device_time, device_time_, report.device_time);
    const bool back = reports > half_way(layout.sequence) || ticks > half_way(layout.device_time);
    if (reports == 0 || (back && !after_silence)) return false;
    sample_.sequence += reports;
    sample_.missing += static_cast<std::uint32_t>(reports - 1);
    device_ticks_ += ticks;
  } else {
    sample_.sequence = report.sequence;
    device_ticks_ = report.device_time;
    heard_ = true;
  }
  if (after_silence) {
    sample_.fault = Fault::sample_stale;
    reported_.reset();  // nothing to compare motion with
  }
  sequence_ = report.sequence;
  device_time_ = report.device_time;
  silent_since_ = arrived;
  return true;
}

void ProfileDevice::take(const Arrival& newest) noexcept {
  const PoseReport& report = newest.report;
  pass_time(newest.arrived);
  note_acknowledged(report.acknowledged);
  sample_.fresh = true;
  sample_.buttons = report.buttons;
  sample_.motors_on = report.motors_on;
  sample_.watchdog_tripped = report.watchdog_tripped;
  const Fault fault = judge(report);
  if (fault != Fault::none) {
    sample_.fault = fault;
    return;
  }
  sample_.X_BH = *reported_;
  sample_.V_BH = report.V_BH;
}

/// Moves arrival and device time on to a new sample. A device without a clock lives by the host's.
void ProfileDevice::pass_time(TimePoint arrived) noexcept {
  const ReportField& field = profile_.pose_report.device_time;
  if (field.present) {
    sample_.device_time_s = field.step * static_cast<double>(device_ticks_);
  } else if (sample_.arrived != TimePoint{}) {
    sample_.device_time_s += seconds(arrived - sample_.arrived);
  }
  sample_.arrived = arrived;
}

/// The most time that can have passed since the last pose that was one [s]: a coarse clock must not make
/// motion look fast. Never more than the time after which silence is a fault anyway.
double ProfileDevice::elapsed_s() const noexcept {
  const ReportField& field = profile_.pose_report.device_time;
  const double one_tick_s = field.present ? field.step : 0.0;
  return std::min(sample_.device_time_s - reported_at_s_ + one_tick_s, profile_.stale_fault_s);
}

/// The newest command whose low bits the device names, if it was sent since open(). What the device names
/// until it takes one of these is somebody else's.
void ProfileDevice::note_acknowledged(std::uint32_t raw) noexcept {
  const ReportField& field = profile_.pose_report.acknowledged;
  if (!field.present || raw == acknowledged_) return;
  acknowledged_ = raw;
  const std::uint64_t behind = (commands_sent_ - raw) & ((std::uint64_t{1} << field.bits) - 1);
  if (behind < commands_sent_ - sent_before_open_) sample_.acknowledged = commands_sent_ - behind;
}

Fault ProfileDevice::judge(PoseReport report) noexcept {
  if (!is_finite(report.X_BH) || !is_finite(report.V_BH)) return Fault::pose_not_finite;
  const double norm2 = report.X_BH.rotation.squaredNorm();
  if (norm2 < kLeastQuaternionNorm2 || norm2 > kMostQuaternionNorm2) return Fault::pose_not_a_rotation;
  report.X_BH.rotation.normalize();
  const Fault fault = judge_motion(report);
  reported_ = report.X_BH;
  reported_at_s_ = sample_.device_time_s;
  return fault;
}

Fault ProfileDevice::judge_motion(const PoseReport& report) noexcept {
  const double max_v = profile_.max_linear_speed_m_per_s;
  const double max_w = profile_.max_angular_speed_rad_per_s;
  double v = report.V_BH.linear_m_per_s.norm();
  double w = report.V_BH.angular_rad_per_s.norm();
  if (reported_) {
    const double way_m = (report.X_BH.translation_m - reported_->translation_m).norm() - kEncoderStep_m;
    const double turn_rad = report.X_BH.rotation.angularDistance(reported_->rotation) - kEncoderStep_rad;
    const double t = elapsed_s();
    if (way_m > kTeleportFactor * max_v * t || turn_rad > kTeleportFactor * max_w * t)
      return Fault::pose_teleported;
    if (t > 0.0) {
      v = std::max(v, way_m / t);
      w = std::max(w, turn_rad / t);
    }
  }
  fast_samples_ = v > max_v || w > max_w ? fast_samples_ + 1 : 0;
  return fast_samples_ >= kFastSamples ? Fault::overspeed : Fault::none;
}

// --- writing ----------------------------------------------------------------------------------------------

Fault ProfileDevice::write(TimePoint now, const Wrench& F, bool motors_on) noexcept {
  if (!is_finite(F)) {
    send(now, {}, false);
    return Fault::wrench_not_finite;
  }
  if (!motors_on) return send(now, {}, false);
  return send(now,
              {within(F.force_N, profile_.max_force_N, profile_.wrench_report.force.step),
               within(F.torque_Nm, profile_.max_torque_Nm, profile_.wrench_report.torque.step)},
              true);
}

Fault ProfileDevice::send(TimePoint now, const Wrench& F, bool motors_on) noexcept {
  if (!open_) return Fault::device_lost;
  WrenchReport report;
  report.F = F;
  report.hold_time_s =
      std::max(profile_.watchdog_s, profile_.wrench_report.hold_time.step);  // 0 is "default"
  report.sequence = static_cast<std::uint32_t>(++commands_sent_);
  report.enable = motors_on;
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  const std::size_t length = encode(profile_.wrench_report, report, buffer);
  switch (link_.write(now, std::span(buffer).first(length))) {
    case LinkStatus::ok:
      return Fault::none;
    case LinkStatus::empty:
      return Fault::write_failed;
    case LinkStatus::gone:
      break;
  }
  return Fault::device_lost;
}

void ProfileDevice::release(TimePoint now) noexcept {
  for (int i = 0; i < kReleaseReports; ++i) send(now, {}, false);
}

}  // namespace wrenchd
