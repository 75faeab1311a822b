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

/// What other parts of the daemon add to `status`, by its name there. Each is asked on the control thread,
/// and must not wait.
using StatusSections = std::map<std::string, std::function<Json()>>;

/// What the methods of the daemon itself work on.
struct DaemonContext {
  Runtime& runtime;
  EventFeed& feed;
  Lease& lease;
  const StatusSections& status_sections;
};

/// The rows of what every daemon answers: describe, status, devices, events, lease, arming and stopping; and
/// the rows of its events. All must outlive the table.
void add_daemon_methods(MethodTable& table, const DaemonContext& parts);

/// What `status` answers. From a method that is not slow: the lease belongs to that thread.
Json status_json(const DaemonContext& parts);

}  // namespace wrenchd
