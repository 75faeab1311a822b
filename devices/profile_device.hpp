// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/device_profile.hpp"
#include "devices/deflection_pose.hpp"
#include "devices/device.hpp"
#include "devices/kinematics.hpp"
#include "devices/links/report_link.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// A device that its profile describes completely: bytes come and go over a link, the codec gives them
/// meaning, kinematics or a deflection makes a pose of them where the device does not, and what is left here
/// is judgement. Everything after open() is RT safe.
///
/// A device may have fewer than six degrees of freedom. Along those it does not sense it stays where it is,
/// and of a wrench only what it has motors for is sent; DeviceSample tells which, and what was dropped.
///
/// A lock-step device speaks only when spoken to. It is sent zeros when it is opened, and again whenever it
/// has been silent for kLockStepTimeout.
///
/// A fault stands in the sample of the read that found it. It is not latched here: who reads decides what
/// follows, and a later good report reads as good.
class ProfileDevice final : public Device {
 public:
  /// Reports taken from the link in one read: the ring of a Linux hidraw reader. A device that floods the
  /// host costs no more than this a tick.
  static constexpr int kMaxReportsPerRead = 64;
  /// Zero commands that release() sends, so that a lost one does not matter.
  static constexpr int kReleaseReports = 5;
  /// Share of its limits that a device gets which has no watchdog of its own: nothing but the host frees the
  /// hand then.
  static constexpr double kAuthorityWithoutWatchdog = 0.25;
  /// Silence of a lock-step device after which it is spoken to again.
  static constexpr Duration kLockStepTimeout = std::chrono::milliseconds(10);

  /// The link must outlive the device.
  ProfileDevice(DeviceProfile profile, ReportLink& link);

  /// Throws std::runtime_error where the profile cannot work, or the link cannot be opened.
  void open() override;
  /// The first read after open() only empties the link.
  DeviceSample read_newest(TimePoint now) noexcept override;
  /// Cuts the wrench to the profile's limits, force and torque each with its direction kept: the last
  /// ceiling, independent of all limits above. With motors off the wrench sent is zero. A wrench that is not
  /// finite sends zero with the motors off.
  Fault write(TimePoint now, const Wrench& F, bool motors_on) noexcept override;
  void set_proxy_pose(const std::optional<Pose>& X_BG) noexcept override {
    if (deflection_) deflection_->set_proxy_pose(X_BG);
  }
  void release(TimePoint now) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override { link_.wait_readable(deadline); }
  void close() noexcept override;

  const DeviceProfile& profile() const noexcept { return profile_; }
  std::uint64_t commands_sent() const noexcept override { return commands_sent_; }

  /// Joint angles of the last good sample, where the device has joints. RT safe.
  const JointAngles& joint_angles() const noexcept { return joint_angles_; }
  /// Takes over what a calibration has changed of the profile: the frames and the zeros of the joints. The
  /// next pose is not held against the one before. For between the ticks; RT safe.
  void recalibrate(const DeviceProfile& calibrated) noexcept;

 private:
  struct Arrival {
    const PoseReportLayout* layout;
    TimePoint arrived;
  };

  void discard_waiting_reports(TimePoint now) noexcept;
  /// Oldest to newest, counting, into state_. The newest; empty where nothing good arrived.
  std::optional<Arrival> drain(TimePoint now) noexcept;
  const PoseReportLayout* layout(std::size_t index) const noexcept;
  /// Takes a report into state_, or says why not.
  const PoseReportLayout* decode_report(std::span<const std::uint8_t> bytes, TimePoint arrived) noexcept;
  bool accept_counters(const PoseReportLayout& layout, const PoseReport& report, TimePoint arrived) noexcept;
  bool silent_too_long(TimePoint now) const noexcept;
  void update_sample(const Arrival& newest) noexcept;
  void update_device_time(const Arrival& newest) noexcept;
  double elapsed_s() const noexcept;
  void update_acknowledged() noexcept;
  /// The pose the reports make, X_BH and V_BH; a fault where they make none.
  Fault compute_pose(PoseReport& report) noexcept;
  Fault validate_pose(PoseReport report) noexcept;
  Fault validate_motion(const PoseReport& report) noexcept;
  void integrate_deflection(TimePoint now) noexcept;
  void apply_deflection(const PoseReport& report) noexcept;
  void prompt_device(TimePoint now) noexcept;

  Fault send(TimePoint now, const Wrench& F, bool motors_on) noexcept;
  Fault transmit(TimePoint now, std::span<const std::uint8_t> bytes) noexcept;
  /// What the device is told for a wrench on the hand about H in B.
  void fill_wrench(const Wrench& F_B, WrenchReport& report) const noexcept;

  DeviceProfile profile_;
  ReportLink& link_;
  bool open_ = false;
  bool disconnected_ = false;

  bool same_frames_ = true;         ///< D is B and E is H
  std::uint64_t pose_layouts_ = 0;  ///< reports that carry a part of the pose, as bits; 0 is pose_report
  const ReportField* device_time_field_ = nullptr;  ///< of the device, where it has one
  const ReportField* acknowledged_field_ = nullptr;

  DeviceSample sample_;                        ///< the last one given out
  PoseReport state_;                           ///< what the reports said last, each for its part
  std::uint64_t layouts_since_open_ = 0;       ///< that came since open(), as bits
  std::uint64_t layouts_this_read_ = 0;        ///< that came in this read
  bool report_received_ = false;               ///< a good report came since open()
  std::optional<TimePoint> silent_since_;      ///< arrival of the last good report, or the first read
  std::uint64_t sequence_ = 0;                 ///< raw, of the last good report
  std::uint64_t device_time_ = 0;              ///< raw, likewise
  std::uint64_t device_ticks_ = 0;             ///< the same, unwrapped
  std::optional<std::uint64_t> acknowledged_;  ///< raw, likewise
  std::optional<Pose> previous_pose_;          ///< last pose that was a pose, teleported or not
  double previous_pose_time_s_ = 0.0;          ///< device time of that pose
  int overspeed_samples_ = 0;                  ///< samples in a row that were over speed

  JointAngles joint_angles_{};     ///< of the last sample, where the device has joints
  Pose X_DE_;                      ///< likewise
  Matrix3d J_ = Matrix3d::Zero();  ///< at that place: what the motors are told is computed by it
  bool kinematics_valid_ = false;  ///< joint_angles_, X_DE_ and J_ are those of a good sample
  std::optional<DeflectionPose> deflection_;
  TimePoint deflection_time_{};  ///< time the deflection has been followed to
  TimePoint prompted_at_{};      ///< when a lock-step device was last spoken to

  std::uint64_t commands_sent_ = 0;  ///< also the unwrapped sequence of the last one
  std::uint64_t sent_before_open_ = 0;
};

}  // namespace wrenchd
