// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"
#include "daemon/run_config.hpp"
#include "devices/simulation/device_in_hand.hpp"

namespace wrenchd {

/// Adds the methods that move the hand of a simulated device. device: in this process; null: a real device,
/// or a simulated one in another process. device and config must outlive the table. Not RT-safe: allocates.
void add_hand_methods(MethodTable& table, DeviceInHand* device, const RunConfig& config);

}  // namespace wrenchd
