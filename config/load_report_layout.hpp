// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/toml_reader.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

// Report layouts of a profile. Read the limits and the kinematics first: fields must cover their range. The
// functions reject overlapping fields, fields outside of the report, reports that do not determine a pose,
// and reports that cannot be distinguished. Not RT-safe: allocate.

/// Reads [pose_report]. value: the same table, to query its keys.
void read_pose_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value);
/// Reads one of [[more_reports]]: any part of a pose; all fields are optional.
void read_more_report(TomlTable& table, PoseReportLayout& layout, const DeviceProfile& profile);
/// Reads [wrench_report].
void read_wrench_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value);

/// Rejects a profile whose reports do not determine a pose.
void check_pose_complete(const TomlValue& pose_report, const DeviceProfile& profile);
/// Rejects reports with the same id or length.
void check_distinguishable(const TomlValue& pose_report, const TomlValue& more_reports,
                           const DeviceProfile& profile);

}  // namespace wrenchd
