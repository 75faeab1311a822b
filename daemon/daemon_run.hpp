// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "daemon/run_config.hpp"
#include "daemon/run_context.hpp"

namespace wrenchd {

/// Runs the daemon from the checked configuration of each hand to its end: link, runtime, recordings, control
/// socket and servo loop. Returns the fault that ended the run, of two hands that of the first one if it has
/// one; else Fault::none. Throws std::exception if a device, a file or the kernel rejects what the
/// configuration needs. Not RT-safe: returns when the run is over.
Fault run_daemon(std::vector<RunConfig> hands, const RunContext& context);

}  // namespace wrenchd
