// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "daemon/control_methods.hpp"
#include "daemon/event_feed.hpp"
#include "daemon/json_rpc.hpp"
#include "daemon/lease.hpp"

namespace wrenchd {

class Station;

/// What the methods of the daemon itself work on.
struct DaemonParts {
  Station& station;
  EventFeed& feed;
  Lease& lease;
};

/// The rows of what every daemon answers: describe, status, devices, events, lease, arming and stopping; and
/// the rows of its events. All must outlive the table.
void add_daemon_methods(MethodTable& table, const DaemonParts& parts);

/// What `status` answers. From a method that is not slow: the lease belongs to that thread.
Json status_json(const DaemonParts& parts);

}  // namespace wrenchd
