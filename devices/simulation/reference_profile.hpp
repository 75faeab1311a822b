// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"

namespace wrenchd {

/// The wrenchd reference report layout, version 1 (devices/README.md), with the limits of the loopback
/// device: config/profiles/loopback.toml in C++, for tests and tools that have no file at hand. Not RT safe.
DeviceProfile reference_profile();

}  // namespace wrenchd
