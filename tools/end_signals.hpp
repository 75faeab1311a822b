// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd {

/// From now on, SIGINT, SIGTERM, SIGHUP and SIGQUIT request the end of the command instead of killing it, so
/// that it can release the device or the lease first. A system call that waits returns with EINTR. Not
/// RT-safe: changes the handlers of the process.
void catch_end_signals();

/// Returns true if one of these signals has arrived since the program started. RT-safe.
bool end_requested() noexcept;

}  // namespace wrenchd
