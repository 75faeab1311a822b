// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/toml_reader.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Reads [pose_report] and [wrench_report] of a profile. The profile's limits must have been read before: a
/// field has to reach them. Refuses fields that overlap, or that stand outside of the report.
void read_pose_report(TomlTable& table, DeviceProfile& profile);
void read_wrench_report(TomlTable& table, DeviceProfile& profile);

}  // namespace wrenchd
