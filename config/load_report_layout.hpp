// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/toml_reader.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

// The reports of a profile. Its limits and its kinematics must have been read before: a field has to reach
// them. Refused: fields that overlap or stand outside of the report, reports that make no pose together, and
// such that cannot be told apart.

/// [pose_report]. `value`: the table itself, for what its other keys make of a key.
void read_pose_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value);
/// One of [[more_reports]]: any part of a pose, and all of it optional.
void read_more_report(TomlTable& table, PoseReportLayout& layout, const DeviceProfile& profile);
/// [wrench_report]
void read_wrench_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value);

/// Whether the reports make a pose together.
void check_pose_complete(const TomlValue& pose_report, const DeviceProfile& profile);
/// Whether a report shows by its id or length which it is.
void check_distinguishable(const TomlValue& pose_report, const TomlValue& more_reports,
                           const DeviceProfile& profile);

}  // namespace wrenchd
