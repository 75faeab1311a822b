// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/host_watchdog.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

bool pushes(const WrenchReportLayout& layout, const WrenchReport& report) noexcept {
  if (layout.enable.present && !report.enable) return false;
  return !report.F.force_N.isZero(0.0) || !report.F.torque_Nm.isZero(0.0) ||
         std::any_of(report.efforts.begin(), report.efforts.end(), [](double e) { return e != 0.0; });
}

}  // namespace

HostWatchdog::HostWatchdog(const DeviceProfile& profile, Duration after) : timeout_(after) {
  if (profile.has_output) layout_ = profile.wrench_report;
}

/// What is no wrench (a sign of life, a calibration) leaves the last wrench standing.
void HostWatchdog::feed(TimePoint now, const Packet& packet) noexcept {
  if (!layout_) return;
  const auto [outcome, report] = decode(*layout_, packet.report());
  if (outcome != Decoding::ok) return;
  last_report_ = report;
  zeros_sent_ = 0;
  due_ = pushes(*layout_, report) ? now + timeout_ : TimePoint::max();
}

bool HostWatchdog::send_zero(TimePoint now, Packet& packet) noexcept {
  if (now < due_) return false;
  WrenchReport nothing = last_report_;
  nothing.F = Wrench{};
  nothing.efforts = {};
  nothing.enable = false;
  nothing.sequence += ++zeros_sent_;
  packet.length = encode(*layout_, nothing, packet.bytes);
  packet.arrives = now;
  due_ = zeros_sent_ < kZeroReports ? now + kZeroInterval : TimePoint::max();
  return true;
}

}  // namespace wrenchd
