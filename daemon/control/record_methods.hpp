// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"
#include "daemon/recording/recordings.hpp"

namespace wrenchd {

/// The rows of record.start, record.stop, record.status, and of the event `recording`. Both must outlive the
/// table.
void add_record_methods(MethodTable& table, Recordings& recordings);

/// What `record.status` answers, and `status` has as `recording`. Waits for nothing.
Json recording_json(const Recordings& recordings);

}  // namespace wrenchd
