// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/toml_reader.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// Reads [kinematics] of a profile: joints and links of a device that sends encoder counts. Not RT-safe:
/// allocates.
void read_kinematics(TomlTable& table, Kinematics& kinematics);

}  // namespace wrenchd
