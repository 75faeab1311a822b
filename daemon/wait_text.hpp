// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/device_profile.hpp"
#include "daemon/servo/wait_reason.hpp"

namespace wrenchd {

/// Returns what the reason is, with numbers, and what the person at the device can do, for example "arming
/// would push 6.1 N, and may push 0.5 N: move the handle 30 mm up"; "" for Kind::none. Not RT-safe:
/// allocates.
std::string wait_text(const WaitReason& reason);

/// Returns why a loop in this state gives no force, and what changes that; "" in states with force. cause:
/// fault that led to the state. reason: of the last tick. Not RT-safe: allocates.
std::string no_force_text(State state, Fault cause, const WaitReason& reason, const DeviceProfile& profile);

}  // namespace wrenchd
