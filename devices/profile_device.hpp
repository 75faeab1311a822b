// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/device_profile.hpp"
#include "devices/device.hpp"
#include "devices/report_codec.hpp"
#include "devices/report_link.hpp"

namespace wrenchd {

/// A device that its profile describes completely: bytes come and go over a link, the codec gives them
/// meaning, and what is left here is judgement. Everything after open() is RT safe.
///
/// A fault stands in the sample of the read that found it. It is not latched here: who reads decides what
/// follows, and a later good report reads as good.
class ProfileDevice final : public Device {
 public:
  /// Reports taken from the link in one read: the ring of a Linux hidraw reader. A device that floods the
  /// host costs no more than this a tick.
  static constexpr int kMostReportsPerRead = 64;
  /// Zero commands that release() sends, so that a lost one does not matter.
  static constexpr int kReleaseReports = 5;

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
  void release(TimePoint now) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override { link_.wait_readable(deadline); }
  void close() noexcept override;

  const DeviceProfile& profile() const noexcept { return profile_; }
  std::uint64_t commands_sent() const noexcept { return commands_sent_; }

 private:
  struct Arrival {
    PoseReport report;
    TimePoint arrived;
  };

  void start(TimePoint now) noexcept;
  /// Oldest to newest, counting. Empty where nothing good arrived.
  std::optional<Arrival> drain(TimePoint now) noexcept;
  bool count_in(const PoseReport& report, TimePoint arrived) noexcept;
  bool silent_too_long(TimePoint now) const noexcept;
  void take(const Arrival& newest) noexcept;
  void pass_time(TimePoint arrived) noexcept;
  double elapsed_s() const noexcept;
  void note_acknowledged(std::uint32_t raw) noexcept;
  Fault judge(PoseReport report) noexcept;
  Fault judge_motion(const PoseReport& report) noexcept;

  Fault send(TimePoint now, const Wrench& F, bool motors_on) noexcept;

  DeviceProfile profile_;
  ReportLink& link_;
  bool open_ = false;
  bool gone_ = false;

  DeviceSample sample_;                        ///< the last one given out
  bool heard_ = false;                         ///< a good report came since open()
  std::optional<TimePoint> silent_since_;      ///< arrival of the last good report, or the first read
  std::uint32_t sequence_ = 0;                 ///< raw, of the last good report
  std::uint32_t device_time_ = 0;              ///< raw, likewise
  std::uint64_t device_ticks_ = 0;             ///< the same, unwrapped
  std::optional<std::uint32_t> acknowledged_;  ///< raw, likewise
  std::optional<Pose> reported_;               ///< last pose that was a pose, teleported or not
  double reported_at_s_ = 0.0;                 ///< device time of that pose
  int fast_samples_ = 0;                       ///< samples in a row that were over speed

  std::uint64_t commands_sent_ = 0;  ///< also the unwrapped sequence of the last one
  std::uint64_t sent_before_open_ = 0;
};

}  // namespace wrenchd
