// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "core/device_profile.hpp"
#include "devices/layout_check.hpp"

namespace wrenchd {

/// Returns the reports that a profile expects in the report descriptor: all input reports, and the output
/// report if the device has motors. As in match_profile(), a report that carries no part of the pose, such as
/// a battery state, may be absent, and reports may be as short as the profile permits. Checksums and constant
/// bytes count as fields. Not RT-safe: allocates.
std::vector<ExpectedReport> expected_reports(const DeviceProfile& profile);

/// Returns true if any report from the device has this field.
inline bool any_report(const DeviceProfile& profile, ReportField PoseReportLayout::*field) noexcept {
  return (profile.pose_report.*field).present ||
         std::any_of(profile.more_reports.begin(), profile.more_reports.end(),
                     [field](const PoseReportLayout& report) { return (report.*field).present; });
}

}  // namespace wrenchd
