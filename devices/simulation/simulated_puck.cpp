// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/simulated_puck.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace wrenchd {
namespace {

constexpr Duration kStep = std::chrono::milliseconds(1);
/// As SimulatedArm::kMaxCatchUp. After a longer gap the hand grasps the puck again.
constexpr Duration kMaxCatchUp = std::chrono::seconds(1);

const PoseReportLayout& layout(const DeviceProfile& profile, std::size_t index) noexcept {
  return index == 0 ? profile.pose_report : profile.more_reports[index - 1];
}

/// Rounds to three counts, scaled to the full deflection.
void round_to_counts(const Vector3d& exact, std::span<int> counts) noexcept {
  const double largest = exact.cwiseAbs().maxCoeff();
  const double scale =
      largest > EmulatedSpaceMouse::kFullScale ? EmulatedSpaceMouse::kFullScale / largest : 1.0;
  for (std::size_t i = 0; i < counts.size(); ++i)
    counts[i] = static_cast<int>(std::lround(scale * exact[static_cast<Eigen::Index>(i)]));
}

}  // namespace

PuckCoding puck_coding(const DeviceProfile& profile) {
  const bool combined = profile.pose_report.translation.present && profile.pose_report.rotation.present;
  PuckCoding coding{combined ? EmulatedSpaceMouse::Format::combined : EmulatedSpaceMouse::Format::split};
  for (std::size_t i = 0; i <= profile.more_reports.size(); ++i) {
    const PoseReportLayout& report = layout(profile, i);
    if (report.translation.present) coding.translation_step_m = report.translation.step;
    if (report.rotation.present) coding.rotation_step_rad = report.rotation.step;
  }
  if (!profile.deflection || coding.translation_step_m == 0.0 || coding.rotation_step_rad == 0.0)
    throw std::invalid_argument("device profile " + profile.name +
                                " cannot be simulated: its reports do not carry both the translation and the "
                                "rotation of a puck; simulate a profile that inherits spacemouse_split");
  return coding;
}

SimulatedPuck::SimulatedPuck(const DeviceProfile& profile, const SimulationSettings& settings)
    : profile_(profile),
      hand_(settings),
      coding_(puck_coding(profile)),
      linear_(*profile.deflection, profile.deflection->linear_gain, profile.deflection->full_deflection_m),
      angular_(*profile.deflection, profile.deflection->angular_gain,
               profile.deflection->full_deflection_rad),
      mouse_(coding_.format),
      displayed_pose_(initial_pose()) {}

DeflectionPose SimulatedPuck::initial_pose() const noexcept {
  return DeflectionPose(*profile_.deflection, profile_.max_linear_speed_m_per_s,
                        profile_.max_angular_speed_rad_per_s);
}

void SimulatedPuck::open(TimePoint now) {
  displayed_pose_ = initial_pose();
  displayed_at_ = now;
  grasped_at_ = now + kGraspDelay;
  reported_ = {};
}

void SimulatedPuck::inject(const SimulatedFault& fault) {
  using Kind = SimulatedFault::Kind;
  if (fault.kind == Kind::bad_quaternion || fault.kind == Kind::jump)
    throw std::invalid_argument("a puck sends its deflection and no pose; choose another fault");
  if (!affects_link(fault.kind))
    throw std::invalid_argument("an emulated puck does not support this fault; the loopback device does");
  faults_.add(fault);
}

void SimulatedPuck::advance_to(TimePoint t, ReportSink& host) noexcept {
  host_ = &host;
  if (!powered_) {
    powered_ = true;
    power_on_ = now_ = displayed_at_ = t;
    grasped_at_ = t + kGraspDelay;
    faults_.power_on(t);
    mouse_.advance_to(t, *this);
  }
  if (t - now_ > kMaxCatchUp) {
    now_ += (t - now_) / kStep * kStep;
    grasped_at_ = now_ + kGraspDelay;
  }
  while (now_ + kStep <= t) {
    now_ += kStep;
    mouse_.advance_to(now_, *this);
    update_deflection();
  }
}

/// Integrates the displayed pose with the report of the device, and passes the report to the host.
void SimulatedPuck::take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept {
  for (std::size_t i = 0; i <= profile_.more_reports.size(); ++i) {
    const PoseReportLayout& report_layout = layout(profile_, i);
    if (decode_into(report_layout, report, reported_) != Decoding::ok) continue;
    if (!report_layout.translation.present && !report_layout.rotation.present) break;
    integrate_displayed_pose(sent);
    const Quaterniond& R_BD = profile_.X_BD.rotation;
    displayed_pose_.set_deflection(R_BD * reported_.translation_m, R_BD * reported_.rotation_rad);
    break;
  }
  host_->take_report(sent, report);
}

void SimulatedPuck::observe_pose(TimePoint now, const Pose& X_BH) noexcept {
  displayed_pose_.set_pose(X_BH);
  displayed_at_ = std::max(displayed_at_, now);
}

void SimulatedPuck::integrate_displayed_pose(TimePoint now) noexcept {
  displayed_pose_.advance(seconds(now - displayed_at_));
  displayed_at_ = std::max(displayed_at_, now);
}

void SimulatedPuck::update_deflection() noexcept {
  integrate_displayed_pose(now_);
  const Deflection& settings = *profile_.deflection;
  const HandTarget target = hand_.advance(now_, now_ - power_on_, seconds(kStep));
  const Pose& X_BH = displayed_pose_.X_BH();
  Vector3d linear = target.X_BG.translation_m;
  Vector3d angular = rotation_vector(target.X_BG.rotation);
  if (settings.mode == Deflection::Mode::rate) {
    linear = target.V_BG.linear_m_per_s + kCorrection_per_s * (linear - X_BH.translation_m);
    angular = target.V_BG.angular_rad_per_s +
              kCorrection_per_s * rotation_vector(target.X_BG.rotation * X_BH.rotation.conjugate());
  }
  if (now_ < grasped_at_) linear = angular = Vector3d::Zero();
  const Quaterniond R_DB = profile_.X_BD.rotation.conjugate();
  std::array<int, 6> counts{};
  if (settings.mode == Deflection::Mode::rate) {
    linear = linear_.deflection(linear);
    angular = angular_.deflection(angular);
  } else {
    linear /= settings.linear_gain;
    angular /= settings.angular_gain;
  }
  round_to_counts(R_DB * linear / coding_.translation_step_m, std::span(counts).first(3));
  round_to_counts(R_DB * angular / coding_.rotation_step_rad, std::span(counts).last(3));
  if (counts == counts_) return;
  counts_ = counts;
  mouse_.set_deflection(counts);
}

}  // namespace wrenchd
