// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: devices/profile_device.cpp devices/profile_reports.cpp devices/report_codec.cpp
// devices/report_frame.cpp devices/report_bits.cpp devices/layout_validation.cpp devices/kinematics.cpp
// devices/deflection_pose.cpp
#include "tests/fuzz/fuzz_report.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "config/known_profiles.hpp"
#include "core/finite.hpp"
#include "devices/profile_device.hpp"
#include "tests/fuzz/feed.hpp"
#include "tests/fuzz/memory_link.hpp"
#include "tests/support/paths.hpp"

// Reports, pauses, commands and lost links in any order, for each shipped profile, over a link in memory. For
// every order the sample is a valid pose, counters and clocks never decrease, and no command exceeds the
// limits of the profile.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

const std::vector<DeviceProfile>& profiles() {
  static const KnownProfiles known = known_profiles(SearchPath({test::source_path("config")}));
  require(known.rejected.empty() && !known.profiles.empty(), "every shipped profile is valid");
  return known.profiles;
}

/// Decodes each command as the firmware does, and checks it against the limits of the profile.
class Firmware final : public MemoryLink {
 public:
  explicit Firmware(const DeviceProfile& profile) : profile_(profile) {
    const bool watched = profile.watchdog_s > 0.0;
    authority_ = watched ? 1.0 : ProfileDevice::kAuthorityWithoutWatchdog;
  }

 private:
  bool is_fixed(std::span<const std::uint8_t> bytes) const noexcept {
    for (const FixedReport* fixed : {&profile_.keep_alive, &profile_.shutdown})
      if (!fixed->bytes.empty() &&
          std::equal(bytes.begin(), bytes.end(), fixed->bytes.begin(), fixed->bytes.end()))
        return true;
    return false;
  }

  void take_command(std::span<const std::uint8_t> bytes) noexcept override {
    if (is_fixed(bytes)) return;
    require(profile_.has_output, "a device without output receives no commands");
    const WrenchReportLayout& layout = profile_.wrench_report;
    require(bytes.size() == layout.length, "a command has the length of its layout");
    const auto [result, report] = decode(layout, bytes);
    require(result == Decoding::ok, "a command can be decoded");
    const bool off = layout.enable.present && !report.enable;
    const double force_N = off ? 0.0 : authority_ * profile_.max_force_N;
    const double torque_Nm = off || !layout.torque.present ? 0.0 : authority_ * profile_.max_torque_Nm;
    if (layout.force.present) require(report.F.force_N.norm() <= force_N + kRounding, "max_force_N");
    if (layout.torque.present) require(report.F.torque_Nm.norm() <= torque_Nm + kRounding, "max_torque_Nm");
    if (!layout.efforts.present) return;
    const double most = off ? 0.0 : profile_.kinematics.max_effort;
    for (const double effort : report.efforts)
      require(std::abs(effort) <= most + std::abs(layout.efforts.step), "max_effort");
  }

  static constexpr double kRounding = 1e-9;
  const DeviceProfile& profile_;
  double authority_;
};

void fix_frame(const ReportFrame& frame, std::span<std::uint8_t> bytes) {
  if (frame.has_id) bytes[0] = frame.id;
  for (const auto& [byte, value] : frame.constants) bytes[byte] = value;
  if (frame.checksum == Checksum::none) return;
  const bool crc = frame.checksum == Checksum::crc16_ccitt_false;
  const std::size_t slot = frame.checksum_at.value_or(frame.length - (crc ? 2 : 1));
  const auto covered = bytes.first(slot).subspan(frame.checksum_from);
  unsigned sum = crc ? crc16_ccitt_false(covered) : 0;
  for (const std::uint8_t b : covered) {
    if (frame.checksum == Checksum::sum8) sum += b;
    if (frame.checksum == Checksum::xor8) sum ^= b;
  }
  bytes[slot] = static_cast<std::uint8_t>(sum);
  if (crc) bytes[slot + 1] = static_cast<std::uint8_t>(sum >> 8);
}

/// A device and its host, from open() to close().
class Session {
 public:
  explicit Session(const DeviceProfile& profile)
      : profile_(profile), link_(profile), device_(profile, link_) {
    open();
  }

  void run(Feed feed) {
    while (!feed.empty()) step(feed);
    device_.release(now_);
    read();
    device_.close();
    read();
  }

 private:
  void open() {
    device_.open();
    previous_ = {};
    has_previous_ = false;
  }

  void step(Feed& feed) {
    switch (static_cast<Step>(feed.byte() % kSteps)) {
      case Step::advance: {
        const unsigned b = feed.byte();
        now_ += std::chrono::microseconds((1 + b % 16) << (b / 16));
        break;
      }
      case Step::read:
        read();
        break;
      case Step::raw:
        send_raw(feed);
        break;
      case Step::framed:
        send_framed(feed);
        break;
      case Step::plausible:
        send_plausible(feed);
        break;
      case Step::command:
        command(feed);
        break;
      case Step::link:
        change_link(feed.byte());
        break;
      case Step::sleep:
        now_ += std::chrono::seconds(1 + feed.byte());
        break;
    }
  }

  void send_raw(Feed& feed) {
    std::array<std::uint8_t, kMaxReportBytes> bytes;
    const auto report = std::span(bytes).first(feed.byte() % (kMaxReportBytes + 1));
    feed.fill(report);
    link_.arrive(now_, report);
  }

  const PoseReportLayout& layout(unsigned which) const {
    const std::size_t i = which % (1 + profile_.more_reports.size());
    return i == 0 ? profile_.pose_report : profile_.more_reports[i - 1];
  }

  void send_framed(Feed& feed) {
    const PoseReportLayout& kind = layout(feed.byte());
    std::array<std::uint8_t, kMaxReportBytes> bytes;
    const auto report = std::span(bytes).first(kind.length);
    feed.fill(report);
    fix_frame(kind, report);
    link_.arrive(now_, report);
  }

  /// Sends the previous report with small changes; then corrupts up to three of its bytes.
  void send_plausible(Feed& feed) {
    const PoseReportLayout& kind = layout(feed.byte());
    const auto small = [&](double step) { return step * feed.signed_byte(); };
    next_.sequence += static_cast<std::uint64_t>(static_cast<std::int64_t>(1 + feed.signed_byte()));
    if (kind.device_time.present)
      next_.device_time += static_cast<std::uint64_t>(
          static_cast<std::int64_t>(1e-5 * feed.signed_word() / kind.device_time.step));
    for (int i = 0; i < 3; ++i) {
      next_.X_BH.translation_m[i] += small(1e-4);
      next_.translation_m[i] = small(1e-4);
      next_.rotation_rad[i] = small(1e-3);
      next_.V_BH.linear_m_per_s[i] = small(2e-2);
      next_.V_BH.angular_rad_per_s[i] = small(0.5);
    }
    next_.X_BH.rotation = Quaterniond(1.0, small(4e-3), small(4e-3), small(4e-3));
    for (double& counts : next_.joints) counts += feed.signed_byte();
    const unsigned flags = feed.byte();
    next_.motors_on = (flags & 1U) != 0;
    next_.watchdog_tripped = (flags & 2U) != 0;
    next_.homed = (flags & 4U) == 0;
    next_.buttons = flags >> 4;
    next_.acknowledged = device_.commands_sent() - (flags >> 5);
    std::array<std::uint8_t, kMaxReportBytes> bytes;
    const auto report = std::span(bytes).first(encode(kind, next_, bytes));
    for (unsigned corruptions = (flags >> 3) & 1U ? feed.byte() % 4 : 0; corruptions > 0; --corruptions)
      report[feed.byte() % report.size()] ^= feed.byte();
    fix_frame(kind, report);
    link_.arrive(now_, report);
  }

  void command(Feed& feed) {
    constexpr std::array<double, 5> kExtreme = {std::numeric_limits<double>::quiet_NaN(),
                                                std::numeric_limits<double>::infinity(), 1e300, -1e300,
                                                5e-324};
    const unsigned flags = feed.byte();
    const double scale = (flags & 2U) != 0 ? 1e-3 : 1.0;
    Wrench F;
    for (int i = 0; i < 3; ++i) {
      F.force_N[i] = scale * feed.signed_word();
      F.torque_Nm[i] = 1e-2 * scale * feed.signed_word();
    }
    const unsigned extreme = flags >> 3;
    if (extreme != 0)
      (extreme % 2 == 0 ? F.force_N : F.torque_Nm)[extreme % 3] = kExtreme[extreme % kExtreme.size()];
    const bool finite = is_finite(F);
    const Fault fault = device_.write(now_, F, (flags & 1U) != 0);
    require(finite || fault == Fault::wrench_not_finite, "a wrench that is not finite is rejected");
  }

  void change_link(unsigned how) {
    switch (how % 6) {
      case 0:
        link_.reading = link_.writing = LinkStatus::disconnected;
        break;
      case 1:
        link_.writing = LinkStatus::not_ready;
        break;
      case 2:
        link_.writing = LinkStatus::ok;
        break;
      case 3:
        device_.release(now_);
        break;
      case 4:
        device_.recalibrate(profile_);
        break;
      default:
        device_.close();
        open();
    }
  }

  void read() {
    const DeviceSample s = device_.read_newest(now_);
    require(is_finite(s.X_BH) && is_finite(s.V_BH), "pose and velocity are finite");
    require(std::abs(s.X_BH.rotation.squaredNorm() - 1.0) < 1e-9, "the quaternion has unit length");
    require(is_finite(s.device_time_s), "device time is finite");
    require(s.acknowledged <= device_.commands_sent(), "only sent commands are acknowledged");
    require(s.superseded + s.rejected <= unsigned{ProfileDevice::kMaxReportsPerRead},
            "the number of reports per read is limited");
    require(s.arrived <= now_, "no report arrives in the future");
    if (has_previous_) {
      require(s.device_time_s >= previous_.device_time_s, "device time does not decrease");
      require(s.sequence >= previous_.sequence, "the sequence does not decrease");
      require(s.arrived >= previous_.arrived, "arrival times do not decrease");
    }
    previous_ = s;
    has_previous_ = true;
  }

  const DeviceProfile& profile_;
  Firmware link_;
  ProfileDevice device_;
  TimePoint now_ = TimePoint{} + std::chrono::seconds(1);
  PoseReport next_;
  DeviceSample previous_;
  bool has_previous_ = false;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Feed feed({data, size});
  const auto& known = profiles();
  Session(known[feed.byte() % known.size()]).run(feed);
  return 0;
}
