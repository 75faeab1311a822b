// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

class ServoLoop;

/// Adds the methods by which another program acts on the hand. loop, feed and config must outlive the table.
/// Not RT-safe: allocates.
void add_wrench_methods(MethodTable& table, ServoLoop& loop, EventFeed& feed, const RunConfig& config);

}  // namespace wrenchd
