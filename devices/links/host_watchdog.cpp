// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/host_watchdog.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

bool is_nonzero(const WrenchReportLayout& layout, const WrenchReport& report) noexcept {
  if (layout.enable.present && !report.enable) return false;
  return !report.F.force_N.isZero(0.0) || !report.F.torque_Nm.isZero(0.0) ||
         std::any_of(report.efforts.begin(), report.efforts.end(), [](double e) { return e != 0.0; });
}

}  // namespace

HostWatchdog::HostWatchdog(const DeviceProfile& profile, Duration after) : timeout_(after) {
  if (profile.has_output) layout_ = profile.wrench_report;
}

/// A report that is not a wrench command (keep-alive, calibration) leaves the last wrench in effect.
void HostWatchdog::feed(TimePoint now, const Packet& packet) noexcept {
  if (!layout_) return;
  const auto [outcome, report] = decode(*layout_, packet.report());
  if (outcome != Decoding::ok) return;
  last_report_ = report;
  zeros_sent_ = 0;
  due_ = is_nonzero(*layout_, report) ? now + timeout_ : TimePoint::max();
}

bool HostWatchdog::send_zero(TimePoint now, Packet& packet) noexcept {
  if (now < due_) return false;
  WrenchReport zero = last_report_;
  zero.F = Wrench{};
  zero.efforts = {};
  zero.enable = false;
  zero.sequence += ++zeros_sent_;
  packet.length = encode(*layout_, zero, packet.bytes);
  packet.arrives = now;
  due_ = zeros_sent_ < kZeroReports ? now + kZeroInterval : TimePoint::max();
  return true;
}

}  // namespace wrenchd
