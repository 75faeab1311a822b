// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/simulated_link.hpp"

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "devices/report_codec.hpp"
#include "devices/simulation/emulated_falcon.hpp"
#include "devices/simulation/emulated_polhem.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"
#include "devices/simulation/simulated_arm.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "devices/simulation/simulated_puck.hpp"

namespace wrenchd {
namespace {

/// Longer than any emulator needs to send all its reports.
constexpr Duration kReportTime = std::chrono::milliseconds(50);

/// Collects the reports of a device, decoded with its profile.
class ReportCollector final : public ReportSink {
 public:
  explicit ReportCollector(const DeviceProfile& profile) : profile_(profile) {}

  void take_report(TimePoint, std::span<const std::uint8_t> bytes) noexcept override {
    bool decoded_one = decode_into(profile_.pose_report, bytes, decoded_) == Decoding::ok;
    for (const PoseReportLayout& report : profile_.more_reports)
      decoded_one = decoded_one || decode_into(report, bytes, decoded_) == Decoding::ok;
    all_decoded_ = all_decoded_ && decoded_one;
    ++reports_;
  }
  bool all_decoded() const noexcept { return all_decoded_ && reports_ > 0; }
  const PoseReport& decoded() const noexcept { return decoded_; }

 private:
  const DeviceProfile& profile_;
  PoseReport decoded_;
  bool all_decoded_ = true;
  int reports_ = 0;
};

[[noreturn]] void reject_layout(const DeviceProfile& profile, const char* emulator, const char* inherits) {
  throw std::invalid_argument("device profile " + profile.name +
                              " cannot be simulated: its reports differ from those of " + emulator +
                              ", which would emulate it; simulate a profile that inherits " + inherits);
}

/// Returns true if the profile decodes the encoder counts from the reports of the arm, and the arm decodes
/// the motor efforts from the commands of the profile. Changes the state of the arm.
bool supports_profile(EmulatedArm& arm, const DeviceProfile& profile) {
  constexpr TimePoint kStart{};
  constexpr JointCounts kCounts = {11, -22, 33, -44, 55, -66};
  constexpr std::array<double, kMaxMotors> kEfforts = {250, -500, 1000};
  ReportCollector collector(profile);
  arm.start();
  arm.set_counts(kCounts);
  arm.advance_to(kStart, collector);
  WrenchReport command;
  const double step = std::abs(profile.wrench_report.efforts.step);
  for (std::size_t i = 0; i < kMaxMotors; ++i) command.efforts[i] = step * kEfforts[i];
  command.enable = true;
  std::array<std::uint8_t, kMaxReportBytes> bytes;
  const std::size_t length = encode(profile.wrench_report, command, bytes);
  if (!arm.take_command(kStart, std::span(bytes).first(length))) return false;
  const MotorEfforts motors = arm.motor_efforts();
  for (std::size_t i = 0; i < kMaxMotors; ++i)
    if (!(std::abs(motors[i] - command.efforts[i]) < 1e-9)) return false;
  arm.advance_to(kStart + kReportTime, collector);
  if (!collector.all_decoded()) return false;
  for (std::size_t i = 0; i < profile.kinematics.joints; ++i) {
    const std::size_t index = profile.kinematics.report_index[i];
    if (collector.decoded().joints[index] != kCounts[index]) return false;
  }
  return true;
}

std::unique_ptr<EmulatedArm> emulated_arm(const DeviceProfile& profile) {
  if (profile.kinematics.kind == Kinematics::Kind::delta) return std::make_unique<EmulatedFalcon>();
  return std::make_unique<EmulatedPolhem>(profile.pose_report.length);
}

std::unique_ptr<DeviceInHand> make_simulated_arm(const DeviceProfile& profile,
                                                 const SimulationSettings& settings) {
  const bool delta = profile.kinematics.kind == Kinematics::Kind::delta;
  if (!profile.wrench_report.efforts.present || !supports_profile(*emulated_arm(profile), profile))
    reject_layout(profile, delta ? "the Falcon" : "Polhem", delta ? "falcon" : "polhem");
  return std::make_unique<SimulatedArm>(profile, settings, emulated_arm(profile));
}

/// Returns true if the profile decodes the deflection from the reports of the puck.
bool supports_profile(const PuckCoding& coding, const DeviceProfile& profile) {
  constexpr TimePoint kStart{};
  constexpr std::array<int, 6> kCounts = {11, -22, 33, -44, 55, -66};
  ReportCollector collector(profile);
  EmulatedSpaceMouse mouse(coding.format);
  mouse.advance_to(kStart, collector);
  mouse.set_deflection(kCounts);
  mouse.advance_to(kStart + kReportTime, collector);
  const PoseReport& decoded = collector.decoded();
  bool same = collector.all_decoded();
  for (int i = 0; i < 3; ++i) {
    const auto n = static_cast<std::size_t>(i);
    same = same && std::lround(decoded.translation_m[i] / coding.translation_step_m) == kCounts[n] &&
           std::lround(decoded.rotation_rad[i] / coding.rotation_step_rad) == kCounts[n + 3];
  }
  return same;
}

std::unique_ptr<DeviceInHand> make_simulated_puck(const DeviceProfile& profile,
                                                  const SimulationSettings& settings) {
  if (!supports_profile(puck_coding(profile), profile))
    reject_layout(profile, "a SpaceMouse", "spacemouse_split or spacemouse_combined");
  return std::make_unique<SimulatedPuck>(profile, settings);
}

}  // namespace

std::unique_ptr<SimulatedLink> make_simulated_link(const DeviceProfile& profile,
                                                   const SimulationSettings& settings, Clock& clock) {
  std::unique_ptr<DeviceInHand> device;
  switch (pose_source(profile)) {
    case PoseSource::pose:
      device = std::make_unique<SimulatedDevice>(profile, settings);
      break;
    case PoseSource::joints:
      device = make_simulated_arm(profile, settings);
      break;
    case PoseSource::deflection:
      device = make_simulated_puck(profile, settings);
      break;
  }
  return std::make_unique<SimulatedLink>(std::move(device), clock, settings);
}

}  // namespace wrenchd
