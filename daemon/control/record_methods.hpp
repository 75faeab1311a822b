// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"
#include "daemon/recording/recordings.hpp"

namespace wrenchd {

/// Adds the methods record.* and the event `recording`. The recordings must outlive the table. Not RT-safe:
/// allocates.
void add_record_methods(MethodTable& table, Recordings& recordings);

/// Returns the result of `record.status`, which is also the member `recording` of `status`. Does not block.
/// Not RT-safe: allocates.
Json recording_json(const Recordings& recordings);

}  // namespace wrenchd
