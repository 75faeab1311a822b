// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/link_settings.hpp"

#include <algorithm>
#include <string>

namespace wrenchd {
namespace {

/// Returns the constant at a byte of a report; 0 if there is none.
std::uint8_t constant_at(const ReportFrame& report, std::size_t byte) {
  for (const ReportConstant& constant : report.constants)
    if (constant.byte == byte) return constant.value;
  return 0;
}

}  // namespace

LinkSettings link_settings(const DeviceProfile& profile, Duration silent_after) {
  LinkSettings settings;
  settings.host_watchdog = HostWatchdog(profile, silent_after);
  settings.max_report_bytes = profile.pose_report.length;
  for (const PoseReportLayout& report : profile.more_reports)
    settings.max_report_bytes = std::max(settings.max_report_bytes, report.length);
  if (profile.transport != Transport::libusb) return settings;
  const UsbEndpoints& endpoints = profile.endpoints;
  settings.in_endpoint = endpoints.in;
  settings.out_endpoint = endpoints.out;
  settings.prefix_bytes = endpoints.prefix_bytes;
  settings.max_report_bytes += endpoints.prefix_bytes;
  if (!endpoints.serial_chip) return settings;
  const PoseReportLayout& report = profile.pose_report;
  settings.frame = {report.length, constant_at(report, 0), constant_at(report, report.length - 1)};
  settings.start_serial = [file = endpoints.firmware](SerialChip& chip) { falcon_open(chip, file); };
  return settings;
}

}  // namespace wrenchd
