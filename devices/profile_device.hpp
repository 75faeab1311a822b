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
#include "devices/pose_observer.hpp"
#include "devices/report_codec.hpp"
#include "devices/velocity_estimator.hpp"

namespace wrenchd {

/// Device that is completely described by its profile. A link transfers the bytes and the codec decodes them.
/// If the device does not send a pose, kinematics or the deflection of a puck gives one. ProfileDevice
/// validates the result.
///
/// A device may have fewer than six degrees of freedom. Along axes without a sensor the pose is constant.
/// Wrench components without a motor are dropped. DeviceSample lists both. A velocity that the device does
/// not report is estimated from its poses (VelocityEstimator).
///
/// ProfileDevice writes nothing to a device before kTrustReports valid reports in a row have shown that its
/// reports are those of the profile. Exception: a lock-step device sends only after it has received a
/// command. ProfileDevice sends it zeros with the motors off after open(), and again whenever it has been
/// silent for kLockStepTimeout. match_profile() decides which devices may get them.
///
/// A sample carries the fault that its read found. ProfileDevice does not latch faults: the caller decides on
/// the reaction, and a later valid report gives a valid sample.
///
/// All members except the constructor, open() and close() are RT-safe.
class ProfileDevice final : public Device {
 public:
  /// Maximum number of reports per read: the capacity of a Linux hidraw reader. It bounds the time of a read
  /// if a device sends too fast.
  static constexpr int kMaxReportsPerRead = 64;
  /// Number of zero commands of release(), so that the loss of one has no effect.
  static constexpr int kReleaseReports = 5;
  /// Valid reports in a row after which a device with motors is trusted to be that of the profile.
  static constexpr int kTrustReports = 5;
  /// Factor of the limits for a device without a watchdog, because then only the host can release the device.
  static constexpr double kAuthorityWithoutWatchdog = 0.25;
  /// Silence of a lock-step device after which ProfileDevice sends a command again.
  static constexpr Duration kLockStepTimeout = std::chrono::milliseconds(10);

  /// The link must outlive the device. If the link also implements PoseObserver, as a simulated link does,
  /// the device sends it each steered pose.
  ProfileDevice(DeviceProfile profile, ReportLink& link);

  /// Throws std::runtime_error if the profile is invalid or the link cannot be opened. Not RT-safe: may take
  /// seconds.
  void open() override;
  /// Returns the newest sample. The first read after open() only discards waiting reports. RT-safe.
  DeviceSample read_newest(TimePoint now) noexcept override;
  /// Scales force and torque to the limits of the profile and keeps their directions. This is the last limit,
  /// independent of all limits above. With motors off it sends a zero wrench. If the wrench is not finite, it
  /// sends zero with the motors off and returns wrench_not_finite. RT-safe.
  Fault write(TimePoint now, const Wrench& F, bool motors_on) noexcept override;
  void set_proxy_pose(const std::optional<Pose>& X_BQ) noexcept override {
    if (deflection_) deflection_->set_proxy_pose(X_BQ);
  }
  void release(TimePoint now) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override { link_.wait_readable(deadline); }
  void close() noexcept override;

  const DeviceProfile& profile() const noexcept { return profile_; }
  std::uint64_t commands_sent() const noexcept override { return commands_sent_; }
  /// Returns true if the reports since open() have been those of the profile. RT-safe.
  bool trusted() const noexcept { return trusted_reports_ >= kTrustReports; }
  /// Trusts a far end that is no device, until the next open(): a tool that only encodes commands. RT-safe.
  void assume_trusted() noexcept { trusted_reports_ = kTrustReports; }

  /// Returns the joint angles of the last valid sample, if the device has joints. RT-safe.
  const JointAngles& joint_angles() const noexcept { return joint_angles_; }
  /// Applies the calibrated frames and joint zeros of a profile. The next pose is not compared with the
  /// previous one. Call it between ticks. RT-safe.
  void recalibrate(const DeviceProfile& calibrated) noexcept;

 private:
  struct Arrival {
    const PoseReportLayout* layout;
    TimePoint arrived;
  };

  void discard_waiting_reports(TimePoint now) noexcept;
  /// Decodes all waiting reports into state_, oldest first, and counts them. Returns the newest; empty if no
  /// valid report arrived.
  std::optional<Arrival> drain(TimePoint now) noexcept;
  const PoseReportLayout* layout(std::size_t index) const noexcept;
  /// Decodes a report into state_ and returns its layout; nullptr if it is invalid.
  const PoseReportLayout* decode_report(std::span<const std::uint8_t> bytes, TimePoint arrived) noexcept;
  bool accept_counters(const PoseReportLayout& layout, const PoseReport& report, TimePoint arrived) noexcept;
  bool silent_too_long(TimePoint now) const noexcept;
  void update_sample(const Arrival& newest) noexcept;
  void update_device_time(const Arrival& newest) noexcept;
  double elapsed_s() const noexcept;
  void update_acknowledged() noexcept;
  /// Computes X_BH and V_BH from the reports. Returns a fault if they give no pose.
  Fault compute_pose(PoseReport& report) noexcept;
  Fault validate_pose(PoseReport report) noexcept;
  Fault validate_motion(const PoseReport& report) noexcept;
  /// Discards the poses before a gap, a fault or a change of the frames.
  void forget_motion() noexcept;
  /// Replaces the components of V that the device does not report by their estimates.
  void estimate_velocity(Twist& V_BH) noexcept;
  void integrate_deflection(TimePoint now) noexcept;
  void apply_deflection(const PoseReport& report) noexcept;
  void prompt_device(TimePoint now) noexcept;
  /// Returns true if the device declares a report that no layout of the profile describes.
  bool is_other_report(std::span<const std::uint8_t> bytes) const noexcept;
  /// Counts the evidence that the device is that of the profile, until it is trusted.
  void judge(bool valid) noexcept;

  Fault send(TimePoint now, const Wrench& F, bool motors_on) noexcept;
  Fault transmit(TimePoint now, std::span<const std::uint8_t> bytes) noexcept;
  /// Fills the command for a wrench on the hand about H in B.
  void fill_wrench(const Wrench& F_B, WrenchReport& report) const noexcept;

  DeviceProfile profile_;
  ReportLink& link_;
  PoseObserver* pose_observer_;  ///< the link, if it observes the steered pose; otherwise null
  bool open_ = false;
  bool disconnected_ = false;

  bool same_frames_ = true;  ///< true if D = B and E = H
  /// Bit mask of the reports that carry a part of the pose; bit 0 is pose_report.
  std::uint64_t pose_layouts_ = 0;
  const ReportField* device_time_field_ = nullptr;  ///< device_time field; null if the device has no clock
  const ReportField* acknowledged_field_ = nullptr;

  DeviceSample sample_;                   ///< sample returned by the last read
  PoseReport state_;                      ///< content of the last reports, merged
  std::uint64_t layouts_since_open_ = 0;  ///< bit mask of the layouts received since open()
  std::uint64_t layouts_this_read_ = 0;   ///< bit mask of the layouts received in this read
  bool report_received_ = false;          ///< true if a valid report arrived since open()
  /// Arrival time of the last valid report, or time of the first read.
  std::optional<TimePoint> silent_since_;
  std::uint64_t sequence_ = 0;                 ///< raw sequence of the last valid report
  std::uint64_t device_time_ = 0;              ///< raw device time of the last valid report
  std::uint64_t device_ticks_ = 0;             ///< device time of the last valid report, unwrapped
  std::optional<std::uint64_t> acknowledged_;  ///< raw acknowledged sequence of the last valid report
  std::optional<Pose> previous_pose_;          ///< last valid pose, also if it jumped
  double previous_pose_time_s_ = 0.0;          ///< device time of previous_pose_
  int overspeed_samples_ = 0;                  ///< consecutive samples above the speed limit
  int trusted_reports_ = 0;                    ///< valid reports in a row, at most kTrustReports
  VelocityEstimator velocity_;
  DofMask estimated_velocity_dofs_ = kNoDof;

  JointAngles joint_angles_{};     ///< angles of the last sample, if the device has joints
  Pose X_DE_;                      ///< pose of E at joint_angles_
  Matrix3d J_ = Matrix3d::Zero();  ///< Jacobian at joint_angles_, which converts forces to motor efforts
  bool kinematics_valid_ = false;  ///< true if joint_angles_, X_DE_ and J_ belong to a valid sample
  std::optional<DeflectionPose> deflection_;
  TimePoint deflection_time_{};  ///< time up to which the deflection has been integrated
  TimePoint prompted_at_{};      ///< time at which a lock-step device was last prompted

  std::uint64_t commands_sent_ = 0;  ///< number of commands sent; also the unwrapped sequence of the last one
  std::uint64_t sent_before_open_ = 0;
};

}  // namespace wrenchd
