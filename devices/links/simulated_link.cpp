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

/// Longer than any emulator takes to say what it has to say.
constexpr Duration kTalk = std::chrono::milliseconds(50);

/// What a device says, as the profile understands it.
class Listener final : public ReportSink {
 public:
  explicit Listener(const DeviceProfile& profile) : profile_(profile) {}

  void take_report(TimePoint, std::span<const std::uint8_t> bytes) noexcept override {
    bool known = decode_into(profile_.pose_report, bytes, heard_) == Decoding::ok;
    for (const PoseReportLayout& report : profile_.more_reports)
      known = known || decode_into(report, bytes, heard_) == Decoding::ok;
    understood_ = understood_ && known;
    ++reports_;
  }
  bool understood() const noexcept { return understood_ && reports_ > 0; }
  const PoseReport& heard() const noexcept { return heard_; }

 private:
  const DeviceProfile& profile_;
  PoseReport heard_;
  bool understood_ = true;
  int reports_ = 0;
};

[[noreturn]] void refuse_layout(const DeviceProfile& profile, const char* emulator, const char* inherits) {
  throw std::invalid_argument("device profile " + profile.name +
                              " cannot be simulated: its reports are not those of " + emulator +
                              ", which would stand in for it; simulate a profile that inherits " + inherits);
}

/// Whether the profile finds in the arm's reports what its encoders count, and the arm in the profile's
/// commands what its motors shall do. The arm is used up by it.
bool speaks(EmulatedArm& arm, const DeviceProfile& profile) {
  constexpr TimePoint kStart{};
  constexpr JointCounts kCounts = {11, -22, 33, -44, 55, -66};
  constexpr std::array<double, kMaxMotors> kEfforts = {250, -500, 1000};
  Listener listener(profile);
  arm.start();
  arm.set_counts(kCounts);
  arm.advance_to(kStart, listener);
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
  arm.advance_to(kStart + kTalk, listener);
  if (!listener.understood()) return false;
  for (std::size_t i = 0; i < profile.kinematics.joints; ++i) {
    const std::size_t slot = profile.kinematics.report_index[i];
    if (listener.heard().joints[slot] != kCounts[slot]) return false;
  }
  return true;
}

std::unique_ptr<EmulatedArm> emulated_arm(const DeviceProfile& profile) {
  if (profile.kinematics.kind == Kinematics::Kind::delta) return std::make_unique<EmulatedFalcon>();
  return std::make_unique<EmulatedPolhem>(profile.pose_report.length);
}

std::unique_ptr<DeviceInHand> held_arm(const DeviceProfile& profile, const SimulationSettings& settings) {
  const bool delta = profile.kinematics.kind == Kinematics::Kind::delta;
  if (!profile.wrench_report.efforts.present || !speaks(*emulated_arm(profile), profile))
    refuse_layout(profile, delta ? "the Falcon" : "Polhem", delta ? "falcon" : "polhem");
  return std::make_unique<SimulatedArm>(profile, settings, emulated_arm(profile));
}

/// Whether the profile finds in the reports how far the cap is pushed.
bool speaks(const PuckCoding& cap, const DeviceProfile& profile) {
  constexpr TimePoint kStart{};
  constexpr std::array<int, 6> kCounts = {11, -22, 33, -44, 55, -66};
  Listener listener(profile);
  EmulatedSpaceMouse mouse(cap.format);
  mouse.advance_to(kStart, listener);
  mouse.set_deflection(kCounts);
  mouse.advance_to(kStart + kTalk, listener);
  const PoseReport& heard = listener.heard();
  bool same = listener.understood();
  for (int i = 0; i < 3; ++i) {
    const auto n = static_cast<std::size_t>(i);
    same = same && std::lround(heard.translation_m[i] / cap.translation_step_m) == kCounts[n] &&
           std::lround(heard.rotation_rad[i] / cap.rotation_step_rad) == kCounts[n + 3];
  }
  return same;
}

std::unique_ptr<DeviceInHand> held_cap(const DeviceProfile& profile, const SimulationSettings& settings) {
  if (!speaks(puck_coding(profile), profile))
    refuse_layout(profile, "a SpaceMouse", "spacemouse_split or spacemouse_combined");
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
      device = held_arm(profile, settings);
      break;
    case PoseSource::deflection:
      device = held_cap(profile, settings);
      break;
  }
  return std::make_unique<SimulatedLink>(std::move(device), clock, settings);
}

}  // namespace wrenchd
