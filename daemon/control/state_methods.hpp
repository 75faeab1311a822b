// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"

namespace wrenchd {

class Runtime;

/// Adds state.open and state.obstacles, and creates the shared memory of the runtime. Precondition: the loop
/// does not run yet. The runtime must outlive the table. Throws std::system_error if the kernel denies the
/// memory. Not RT-safe: allocates.
void add_state_methods(MethodTable& table, Runtime& runtime);

}  // namespace wrenchd
