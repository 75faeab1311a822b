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

LastWord::LastWord(const DeviceProfile& profile, Duration after) : after_(after) {
  if (profile.has_output) layout_ = profile.wrench_report;
}

/// What is no wrench (a sign of life, a calibration) leaves the last wrench standing.
void LastWord::heard(TimePoint now, const Packet& packet) noexcept {
  if (!layout_) return;
  const auto [outcome, report] = decode(*layout_, packet.report());
  if (outcome != Decoding::ok) return;
  last_ = report;
  said_ = 0;
  due_ = pushes(*layout_, report) ? now + after_ : TimePoint::max();
}

bool LastWord::speak(TimePoint now, Packet& packet) noexcept {
  if (now < due_) return false;
  WrenchReport nothing = last_;
  nothing.F = Wrench{};
  nothing.efforts = {};
  nothing.enable = false;
  nothing.sequence += ++said_;
  packet.length = encode(*layout_, nothing, packet.bytes);
  packet.arrives = now;
  due_ = said_ < kTimes ? now + kBetween : TimePoint::max();
  return true;
}

}  // namespace wrenchd
