// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"

namespace wrenchd {

/// Returns the profile of the wrenchd reference report layout, version 1 (devices/README.md), with the limits
/// of the loopback device: config/profiles/loopback.toml in C++, for tests and tools without the file. Not
/// RT-safe: allocates.
DeviceProfile reference_profile();

}  // namespace wrenchd
