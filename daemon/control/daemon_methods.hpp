// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <map>
#include <string>

#include "daemon/control/control_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/control/lease.hpp"

namespace wrenchd {

class Runtime;

/// Members that other parts of the daemon add to the result of `status`, by name. The control thread calls
/// the functions; they must not block.
using StatusSections = std::map<std::string, std::function<Json()>>;

/// The objects that the methods of the daemon use.
struct DaemonContext {
  Runtime& runtime;
  EventFeed& feed;
  Lease& lease;
  const StatusSections& status_sections;
};

/// Adds the methods of every daemon: describe, status, devices, events, lease, arming and stopping; and the
/// events. The objects of `context` must outlive the table. Not RT-safe: allocates.
void add_daemon_methods(MethodTable& table, const DaemonContext& context);

/// Returns the result of `status`. Call it on the control thread, which owns the lease. Not RT-safe:
/// allocates.
Json status_json(const DaemonContext& context);

}  // namespace wrenchd
