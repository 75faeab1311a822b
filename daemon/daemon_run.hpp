// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/run_config.hpp"
#include "daemon/run_context.hpp"

namespace wrenchd {

/// Exit codes of the process beside 0.
inline constexpr int kExitRejected =
    1;  ///< a file, a device or the kernel rejected the configuration; the loop did not start
inline constexpr int kExitFault = 3;  ///< the run ended with a fault that no client acknowledged

/// Returns the exit code for the fault that ended the run; Fault::none: no fault.
constexpr int exit_code(Fault fault) noexcept {
  return fault == Fault::none ? 0 : kExitFault;
}

/// Runs the daemon from the checked configuration to its end: link, runtime, recordings, control socket and
/// servo loop. Returns the fault that ended the run, else Fault::none. Throws std::exception if a device, a
/// file or the kernel rejects what the configuration needs. Not RT-safe: returns when the run is over.
Fault run_daemon(RunConfig config, const RunContext& context);

}  // namespace wrenchd
